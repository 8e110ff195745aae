#pragma once

#include <string>

#include "o80/robot/real_time.hpp"
#include "o80/runtime/backend.hpp"
#include "robot/robot.hpp"

namespace o80 {

/// What the command line of a robot's process says.
struct RunOptions {
  BackendOptions backend;
  RealTimeOptions real_time;
  OptionValues robot;
  bool until_eof = false;  // stop when the standard input ends
  bool help = false;
};

/// Throws InvalidArgument, whose text names the flag and what is allowed.
RunOptions parse_run_options(const RobotTable& table, int argc, char** argv);

/// All flags of a robot's process, its own first.
std::string run_help(const RobotTable& table);

/// One flag of every robot's process.
struct RunFlag {
  const char* name;
  const char* value;  // what follows it; null for a switch
  const char* help;
};

/// Those that do not come from a robot's Config.
const RunFlag* run_flags(std::size_t& count);

}  // namespace o80
