#pragma once

#include <string>

#include "robot/driver/driver_instance.hpp"
#include "robot/loop/loop_options.hpp"

namespace o80 {

/// Options from the command line of a robot's process.
struct RunOptions : LoopOptions {
  OptionValues robot;
  bool has_policy = false;  // --policy was given
};

/// Throws InvalidArgument with the flag and the allowed values.
RunOptions parse_run_options(const RobotTable& table, int argc, char** argv);

/// Help for all flags of a robot's process, those of the robot first.
std::string run_help(const RobotTable& table);

}  // namespace o80
