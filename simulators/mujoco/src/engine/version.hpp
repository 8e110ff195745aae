#pragma once

namespace o80::mujoco {

/// The MuJoCo that this library was built with: "mujoco 4.0.1".
const char* built_with();

/// Throws DriverError, naming both versions and the cure, unless `library` is the version that this
/// library was built with.
void check_version(int library, const char* library_text);

}  // namespace o80::mujoco
