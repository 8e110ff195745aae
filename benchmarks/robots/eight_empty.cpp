// A robot of eight actuators that does nothing, for the measurements in Python.

#include "benchmarks/cpp/empty_robot.hpp"

O80_ROBOT(eight_empty, o80::bench::EightWithSensors);
