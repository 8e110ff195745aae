#pragma once

#include <string>

namespace o80::mujoco {

/// What the files of a model are now, as text: of those in MJCF the contents, of others, such as
/// meshes, size and time of the last change. Files are all those that `path`, or an MJCF file among
/// them, names in quotes.
std::string state_of_files(const std::string& path);

}  // namespace o80::mujoco
