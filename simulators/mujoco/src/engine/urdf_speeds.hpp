#pragma once

#include <map>
#include <string>

namespace o80::mujoco {

/// Reads the speed limits of a URDF file by joint name [rad/s or m/s], which MuJoCo ignores.
/// Empty for other models; joints with a speed of 0 are omitted. Throws
/// DriverError.
std::map<std::string, double> urdf_speeds(const std::string& path);

}  // namespace o80::mujoco
