#include "memory/os/file_lock.hpp"

#include <fcntl.h>

#include <cerrno>
#include <cstring>
#include <utility>

namespace o80 {

namespace {

struct flock one_byte(short type, std::uint64_t byte) noexcept {
  struct flock range{};
  range.l_type = type;
  range.l_whence = SEEK_SET;
  range.l_start = static_cast<off_t>(byte);
  range.l_len = 1;
  return range;
}

}  // namespace

bool is_byte_locked(int descriptor, std::uint64_t byte) noexcept {
  // a read lock conflicts with write locks only
  struct flock range = one_byte(F_RDLCK, byte);
  if (fcntl(descriptor, F_OFD_GETLK, &range) != 0) return errno != EBADF;
  return range.l_type != F_UNLCK;
}

std::string why_locks_are_refused() {
  if (errno == EAGAIN || errno == EACCES) return {};
  return std::string(
             "this system refuses the locks by which o80 knows who lives (fcntl "
             "F_OFD_SETLK: ") +
         std::strerror(errno) + "). If this is a container or sandbox, allow fcntl in its profile";
}

LockFile LockFile::open(const std::string& path, int flags, mode_t permission) {
  LockFile file;
  // the path may name a pipe or a device: opening it must not block or make it the terminal
  file.descriptor_ =
      open_for_this_process(path.c_str(), flags | O_CLOEXEC | O_NONBLOCK | O_NOCTTY, permission);
  return file;
}

LockFile::LockFile(LockFile&& other) noexcept
    : descriptor_(std::exchange(other.descriptor_, -1)), guard_(other.guard_) {}

LockFile& LockFile::operator=(LockFile&& other) noexcept {
  if (this == &other) return *this;
  close();
  descriptor_ = std::exchange(other.descriptor_, -1);
  guard_ = other.guard_;
  return *this;
}

LockFile::~LockFile() { close(); }

bool LockFile::try_lock(std::uint64_t byte) noexcept {
  struct flock range = one_byte(F_WRLCK, byte);
  return fcntl(descriptor_, F_OFD_SETLK, &range) == 0;
}

void LockFile::close() noexcept {
  if (descriptor_ < 0) return;
  // in a forked child the number may by now belong to another file
  if (!guard_.forked()) close_in_this_process(descriptor_);
  descriptor_ = -1;
}

}  // namespace o80
