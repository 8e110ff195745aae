#include "robot/group/descriptor_limit.hpp"

#include <dirent.h>
#include <sys/resource.h>

#include "o80/base/error.hpp"

namespace o80 {

namespace {

constexpr rlim_t kSpare = 64;  // for the program itself

/// Number of files that this process has open, or a cautious guess without /proc.
rlim_t open_files() {
  DIR* directory = opendir("/proc/self/fd");
  if (directory == nullptr) return 256;
  rlim_t count = 0;
  while (readdir(directory) != nullptr) ++count;
  closedir(directory);
  return count;
}

}  // namespace

void allow_descriptors(std::size_t more, const std::string& what) {
  rlimit limit{};
  if (getrlimit(RLIMIT_NOFILE, &limit) != 0) return;
  const rlim_t needed = open_files() + more + kSpare;
  if (limit.rlim_cur == RLIM_INFINITY || limit.rlim_cur >= needed) return;
  if (limit.rlim_max == RLIM_INFINITY || limit.rlim_max >= needed) {
    limit.rlim_cur = needed;
    if (setrlimit(RLIMIT_NOFILE, &limit) == 0) return;
  }
  throw Error(
      what + " need " + std::to_string(more) + " open files, but the limit of this process is " +
      std::to_string(limit.rlim_max) +
      ": use fewer copies, or raise the hard limit (`ulimit -Hn`, LimitNOFILE= in systemd)");
}

}  // namespace o80
