// o80-run ROBOT [flags]: runs a robot library as a process, without Python.

#include <cstdio>
#include <cstring>
#include <exception>

#include "memory/os/descriptors.hpp"
#include "o80/robot/run.hpp"
#include "robot/driver/library.hpp"

int main(int argc, char** argv) {
  o80::open_standard_descriptors();
  if (argc < 2 || std::strcmp(argv[1], "--help") == 0 || argv[1][0] == '-') {
    std::puts("o80-run ROBOT [flags]   runs a robot; `o80-run ROBOT --help` lists its flags\n");
    for (const o80::RobotFile& robot : o80::find_robots()) {
      std::printf("  %-16s %s\n", robot.name.c_str(), robot.path.c_str());
    }
    return argc >= 2 && std::strcmp(argv[1], "--help") == 0 ? 0 : 2;
  }
  try {
    const o80::RobotLibrary library = o80::RobotLibrary::load(argv[1]);
    return o80::run(*library.table, argc - 1, argv + 1);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "o80: %s\n", error.what());
    return 1;
  }
}
