#pragma once

#include "o80/robot/make_table.hpp"

namespace o80 {

/// Runs a robot as a process: options from the command line, signals, messages.
/// Returns 0 after a clean end, 1 after a failure, 2 for invalid options.
int run(const RobotTable& table, int argc, char** argv);

/// File name of a path: "arm" for "build/arm".
const char* program_name(const char* path) noexcept;

/// Runs a robot from a program's main:
/// `int main(int argc, char** argv) { return o80::run<Arm>(argc, argv); }`
/// The robot takes the name of the program unless a name is given.
template <class D>
int run(int argc, char** argv, const char* name = nullptr) {
  return run(*robot_table<D>(name == nullptr ? program_name(argv[0]) : name), argc, argv);
}

}  // namespace o80
