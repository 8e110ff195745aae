#pragma once

#include <string>

#include "engine/pointers.hpp"

namespace o80::mujoco {

/// Parses an MJCF file. Throws DriverError. `what`: the option that names the file.
SpecPointer parsed(const std::string& path, const char* what);

/// Adds all elements of a second MJCF file to the world of `spec`, under their names. The second
/// file's sensors may name elements of `spec`; its <option>, <size> and <visual> are ignored.
/// Throws DriverError.
void add_things(mjSpec& spec, const std::string& path);

}  // namespace o80::mujoco
