#include "memory/segment/anonymous_file.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>

#include "memory/os/random_bits.hpp"
#include "memory/segment/segment_name.hpp"

namespace o80 {

namespace {

constexpr const char* kUnlinkedName = "anonymous";  // its drafts are orphans from the beginning

std::string path_of_descriptor(int descriptor) {
  return "/proc/self/fd/" + std::to_string(descriptor);
}

}  // namespace

LockFile create_anonymous() {
  LockFile file = LockFile::open(segment_directory(), O_RDWR | O_TMPFILE, 0600);
  // EISDIR: a kernel without O_TMPFILE
  const bool unsupported = errno == EOPNOTSUPP || errno == EISDIR || errno == EINVAL;
  if (!file.is_open() && unsupported) return create_unlinked();
  return file;
}

LockFile create_unlinked() {
  const std::string path = draft_path(kUnlinkedName, random_bits());
  LockFile file = LockFile::open(path, O_RDWR | O_NOFOLLOW | O_CREAT | O_EXCL, 0600);
  if (file.is_open()) unlink(path.c_str());
  return file;
}

LockFile open_again(const LockFile& file, int flags) {
  return LockFile::open(path_of_descriptor(file.descriptor()), flags);
}

bool link_open_file(const LockFile& file, const std::string& path) noexcept {
  return linkat(AT_FDCWD, path_of_descriptor(file.descriptor()).c_str(), AT_FDCWD, path.c_str(),
                AT_SYMLINK_FOLLOW) == 0;
}

}  // namespace o80
