#include "driver/driver.hpp"
#include "engine/version.hpp"

O80_ROBOT_WITH(mujoco, o80::mujoco::MujocoDriver, o80::mujoco::built_with());
