#include "memory/os/descriptors.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>

namespace o80 {

void open_standard_descriptors() noexcept {
  for (const int wanted : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) {
    if (fcntl(wanted, F_GETFD) >= 0 || errno != EBADF) continue;
    // gets the lowest free number; not close-on-exec, for the programs that this one starts
    const int opened = ::open("/dev/null", wanted == STDIN_FILENO ? O_RDONLY : O_WRONLY);
    if (opened > wanted) ::close(opened);  // another thread has taken the number
  }
}

int above_standard(int descriptor) noexcept {
  if (descriptor < 0 || descriptor > STDERR_FILENO) return descriptor;
  const int higher = fcntl(descriptor, F_DUPFD_CLOEXEC, STDERR_FILENO + 1);
  const int error = errno;
  ::close(descriptor);
  errno = error;
  return higher;
}

}  // namespace o80
