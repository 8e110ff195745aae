#pragma once

#include <sys/types.h>

#include <string>

namespace o80 {

/// The name of a user, or its number if it has none.
std::string user_name(uid_t user);

/// Why the owner of the file is not trusted; empty if it is.
///
/// Every user may create a file in the directory of segments under the name of a robot. Trusted
/// are root, this user, the users in the environment variable O80_TRUST (names or numbers,
/// separated by commas), and any owner of a file that a group of this user may read: only members
/// can create files of a group. See docs/users.md.
std::string why_untrusted(int descriptor);

/// The name of the user that owns the file of that path (of a link, not of its target).
std::string owner_of(const std::string& path);

}  // namespace o80
