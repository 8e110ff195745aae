#pragma once

#include <sys/types.h>

#include <cstdint>
#include <string_view>

#include "memory/os/inheriting_mutex.hpp"

namespace o80 {

/// Number of forks between the first process and this one.
std::uint64_t process_generation() noexcept;

/// Locked around every fork, so that process-wide lists are consistent in the child.
InheritingMutex& fork_mutex() noexcept;

/// open(2) of a file that every forked child closes at once, with a descriptor from 3 on. No fork
/// can happen during the call.
int open_for_this_process(const char* path, int flags, mode_t permission);
/// socket(2) with the same promise.
int socket_for_this_process(int domain, int type);
/// Closes such a file in this process.
void close_in_this_process(int descriptor) noexcept;

/// Ends a child that was forked inside a function of the user and returned from it: the robot and
/// the segment belong to its parent. `robot`: its name; `function`: for example "write".
[[noreturn]] void end_forked_child(std::string_view robot, std::string_view function) noexcept;

/// Remembers the process in which an object was constructed.
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
