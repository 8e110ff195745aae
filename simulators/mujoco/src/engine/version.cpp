#include "engine/version.hpp"

#include <mujoco/mujoco.h>

#include <string>

#include "o80/base/error.hpp"

namespace o80::mujoco {
namespace {

/// 4000001 => "4.0.1"
std::string version_text(int version) {
  return std::to_string(version / 1'000'000) + "." + std::to_string(version / 1000 % 1000) + "." +
         std::to_string(version % 1000);
}

}  // namespace

const char* built_with() {
  static const std::string text = "mujoco " + version_text(mjVERSION_HEADER);
  return text.c_str();
}

void check_version(int library, const char* library_text) {
  if (library == mjVERSION_HEADER) return;
  const std::string built = version_text(mjVERSION_HEADER);
  throw DriverError("the simulator 'mujoco' was built for MuJoCo " + built + ", but MuJoCo " +
                    library_text + " is loaded. Install the version it was built for (pip install" +
                    " mujoco-core==" + built + "), or build o80 again with the installed version");
}

}  // namespace o80::mujoco
