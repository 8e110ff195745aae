#pragma once

#include <memory>
#include <string>
#include <vector>

#include "o80/robot/table.hpp"

namespace o80 {

/// A robot library that is loaded; it stays loaded until the process ends.
struct RobotLibrary {
  std::string path;
  const RobotTable* table = nullptr;

  /// Loads a robot by path, or by name from robot_folders().
  /// Throws DriverError, whose text lists what there is.
  static RobotLibrary load(const std::string& name_or_path);
};

/// Where robots are found by name: O80_ROBOT_PATH (folders parted by ':'), then the folder of the
/// robots that come with o80.
std::vector<std::string> robot_folders();

/// Name and path of every robot library there.
struct RobotFile {
  std::string name;
  std::string path;
};
std::vector<RobotFile> find_robots();

}  // namespace o80
