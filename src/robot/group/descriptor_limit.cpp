#include "robot/group/descriptor_limit.hpp"

#include <sys/resource.h>

#include <filesystem>
#include <iterator>
#include <system_error>

#include "o80/base/error.hpp"

namespace o80 {

namespace {

constexpr rlim_t kSpare = 64;  // for the program itself

/// Number of files that this process has open, or a cautious guess without /proc.
rlim_t open_files() {
  std::error_code error;
  const std::filesystem::directory_iterator files("/proc/self/fd", error);
  return error ? 256 : static_cast<rlim_t>(std::distance(begin(files), end(files)));
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
