#pragma once

#include <string>

#include "memory/os/file_lock.hpp"

namespace o80 {

// Files without a name, for the segments of an inline group. The kernel frees such a file when its
// last descriptor and mapping are gone, so a killed process leaves nothing behind.

/// Creates a file without a name in the directory of the segments; not open, with errno set, on
/// failure. link_open_file() can name it later, unless the file system has no O_TMPFILE.
LockFile create_anonymous();

/// The same for a file system without O_TMPFILE: creates a file under a temporary name, which
/// sweep_orphans() would remove, and unlinks it at once.
LockFile create_unlinked();

/// Opens an open file once more, also if it has no name any more. The result has its own locks and
/// may be mapped.
LockFile open_again(const LockFile& file, int flags);

/// Gives an open file a name; false, with errno set, on failure (EEXIST: the name is in use).
bool link_open_file(const LockFile& file, const std::string& path) noexcept;

}  // namespace o80
