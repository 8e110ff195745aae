#pragma once

#include <string>

namespace o80::mujoco {

/// Text that identifies the present files of a model: contents of MJCF files; size and
/// modification time of others, such as meshes. Includes all files that `path`, or an MJCF file
/// among them, names in quotes.
std::string state_of_files(const std::string& path);

}  // namespace o80::mujoco
