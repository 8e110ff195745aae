#pragma once

#include <sys/types.h>

#include <cstdint>
#include <string>

#include "memory/os/fork.hpp"

namespace o80 {

// The protocol is in src/memory/README.md#locks.
inline constexpr std::uint64_t kBackendByte = 0;     // in both files; observers query the segment
                                                     // file, all others the commanders' file
inline constexpr std::uint64_t kFirstLaneByte = 16;  // in the commanders' file

/// True if a process (or this one, through another descriptor) holds a write lock on that byte.
/// Read locks are ignored, because a process that may only read the file can place them. True where
/// the system refuses the query: whoever may live is not replaced.
bool is_byte_locked(int descriptor, std::uint64_t byte) noexcept;

/// Why try_lock() failed, from errno; empty if another process holds the lock.
std::string why_locks_are_refused();

/// Move-only: an open file for open-file-description locks. Map a file only through a descriptor
/// that has no lock.
///
/// A forked child closes its copy at once, without unlocking: the lock ends with this process and
/// not with the child.
class LockFile {
 public:
  LockFile() noexcept = default;
  /// Opens close-on-exec, from descriptor 3 on; on failure the result is not open and errno is set.
  static LockFile open(const std::string& path, int flags, mode_t permission = 0);
  LockFile(LockFile&& other) noexcept;
  LockFile& operator=(LockFile&& other) noexcept;
  ~LockFile();

  bool is_open() const noexcept { return descriptor_ >= 0; }
  int descriptor() const noexcept { return descriptor_; }
  /// True if this file now holds the lock of the byte.
  bool try_lock(std::uint64_t byte) noexcept;
  void close() noexcept;

 private:
  int descriptor_ = -1;
  ForkGuard guard_;
};

}  // namespace o80
