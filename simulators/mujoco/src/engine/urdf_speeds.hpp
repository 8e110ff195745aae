#pragma once

#include <map>
#include <string>

namespace o80::mujoco {

/// The largest speeds that a URDF file gives its joints, by their names [rad/s or m/s]: what MuJoCo
/// does not read. Empty for other models; joints with a speed of 0 are left out. Throws
/// DriverError.
std::map<std::string, double> urdf_speeds(const std::string& path);

}  // namespace o80::mujoco
