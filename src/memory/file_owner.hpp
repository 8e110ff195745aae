#pragma once

#include <sys/types.h>

#include <string>

namespace o80 {

/// The name of a user, or its number if it has none.
std::string user_name(uid_t user);

/// Why the file behind the descriptor is not to be believed, or an empty text.
///
/// Anybody may create a file in the directory of segments, and so take the name of a robot first.
/// Files of root, of this user and of the users named in the environment variable O80_TRUST
/// (names or numbers with commas between them) are believed. So is a file that lets a group read
/// it of which this user is a member: only members can create files of a group.
std::string why_untrusted(int descriptor);

/// The name of the user who owns the file of that path (a link itself, not its target).
std::string owner_of(const std::string& path);

}  // namespace o80
