#pragma once

#include <string>
#include <vector>

#include "o80/robot/table.hpp"

namespace o80 {

/// A loaded robot library; it stays loaded until the process ends.
struct RobotLibrary {
  std::string path;
  const RobotTable* table = nullptr;

  /// Loads a robot by path, or by name (find_robots()).
  /// Throws DriverError with the known robots in its text.
  static RobotLibrary load(const std::string& name_or_path);
};

/// Name and path of a robot library in the folders in which robots are found by name: those of
/// O80_ROBOT_PATH (separated by ':'), then that of the robots that come with o80.
struct RobotFile {
  std::string name;
  std::string path;
};
std::vector<RobotFile> find_robots();

/// The text of an error: what is there instead of a robot of this name, or how to install it.
std::string no_such_robot(const std::string& name, const std::vector<std::string>& known);

}  // namespace o80
