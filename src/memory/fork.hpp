#pragma once

#include <sys/types.h>

#include <cstdint>
#include <string_view>

#include "memory/inheriting_mutex.hpp"

namespace o80 {

/// How many forks lie between the first process and this one.
std::uint64_t process_generation() noexcept;

/// Locked around every fork: registries of the process are whole in the child.
InheritingMutex& fork_mutex() noexcept;

/// open(2) of a file that the child of every fork closes at once; no fork falls in between.
int open_for_this_process(const char* path, int flags, mode_t permission);
/// Closes it here.
void close_in_this_process(int descriptor) noexcept;

/// Remembers the process an object was made in.
class ForkGuard {
 public:
  ForkGuard() noexcept;
  bool forked() const noexcept { return generation_ != process_generation(); }
  /// Throws UsedAfterFork; `what` is for example "segment 'pam'".
  void check(std::string_view what) const;

 private:
  std::uint64_t generation_;
};

}  // namespace o80
