#pragma once

#include "robot/driver/driver_instance.hpp"
#include "robot/loop/loop_options.hpp"

/// Sets options of the loop from names and texts. Throws InvalidArgument.
o80::LoopOptions loop_options_of(const o80::OptionValues& values, o80::LoopOptions otherwise = {});
