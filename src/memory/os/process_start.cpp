#include "memory/os/process_start.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <cstring>

namespace o80 {

ProcessState process_state(int pid) noexcept {
  char text[1024];
  std::snprintf(text, sizeof text, "/proc/%d/stat", pid);
  const int file = ::open(text, O_RDONLY | O_CLOEXEC);
  if (file < 0) return {};
  const ssize_t size = ::read(file, text, sizeof text - 1);
  ::close(file);
  if (size <= 0) return {};
  text[size] = 0;
  // fields 3 and 22; field 2 is a name in parentheses that may contain spaces and parentheses
  const char* const name_end = std::strrchr(text, ')');
  const char* at = name_end;
  for (int field = 2; at != nullptr && field < 22; ++field) at = std::strchr(at + 1, ' ');
  if (at == nullptr) return {};
  return {.letter = name_end[2], .start = std::strtoull(at, nullptr, 10)};
}

}  // namespace o80
