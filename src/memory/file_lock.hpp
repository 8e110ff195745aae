#pragma once

#include <sys/types.h>

#include <cstdint>
#include <string>

#include "memory/fork.hpp"

namespace o80 {

inline constexpr std::uint64_t kBackendByte = 0;     // of the commanders' file; and, for the
                                                     // queries of observers, of the segment file
inline constexpr std::uint64_t kFirstLaneByte = 16;  // of the commanders' file

/// True if anybody, this process included, holds a write lock on that byte through another
/// descriptor. Read locks do not count: whoever may only read a file can take them.
bool is_byte_locked(int descriptor, std::uint64_t byte) noexcept;

/// Move-only: an open file that is never mapped and bears open-file-description locks.
///
/// A forked child closes its copy at once, without unlocking: the lock dies with this process
/// and with nothing else.
class LockFile {
 public:
  LockFile() noexcept = default;
  /// Opens close-on-exec; not open, with errno set, if that fails.
  static LockFile open(const std::string& path, int flags, mode_t permission = 0);
  LockFile(LockFile&& other) noexcept;
  LockFile& operator=(LockFile&& other) noexcept;
  ~LockFile();

  bool is_open() const noexcept { return descriptor_ >= 0; }
  int descriptor() const noexcept { return descriptor_; }
  /// True if the byte is now held through this file.
  bool try_lock(std::uint64_t byte) noexcept;
  void unlock(std::uint64_t byte) noexcept;
  void close() noexcept;

 private:
  int descriptor_ = -1;
  ForkGuard guard_;
};

}  // namespace o80
