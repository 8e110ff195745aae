#pragma once

namespace o80::mujoco {

/// MuJoCo version of this library's build: "mujoco 4.0.1".
const char* built_with();

/// Throws DriverError, naming both versions and the cure, unless `library` is the version of this
/// library's build.
void check_version(int library, const char* library_text);

}  // namespace o80::mujoco
