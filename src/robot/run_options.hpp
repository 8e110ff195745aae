#pragma once

#include <string>

#include "robot/loop_options.hpp"
#include "robot/robot.hpp"

namespace o80 {

/// What the command line of a robot's process says.
struct RunOptions : LoopOptions {
  OptionValues robot;
};

/// Throws InvalidArgument, whose text names the flag and what is allowed.
RunOptions parse_run_options(const RobotTable& table, int argc, char** argv);

/// All flags of a robot's process, its own first.
std::string run_help(const RobotTable& table);

}  // namespace o80
