#pragma once

#include <string>

#include "engine/pointers.hpp"

namespace o80::mujoco {

/// The spec of an MJCF file. Throws DriverError; `what` is the option that names the file.
SpecPointer parsed(const std::string& path, const char* what);

/// Puts all elements of a second MJCF file into the world of `spec`, under their names. Its
/// sensors may name elements of `spec`; its <option>, <size> and <visual> are left out. Throws
/// DriverError.
void add_things(mjSpec& spec, const std::string& path);

}  // namespace o80::mujoco
