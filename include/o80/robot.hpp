#pragma once

// Headers of a robot library: descriptions, the driver, its table. No frontend, no backend.

#include "o80/base/error.hpp"            // exceptions
#include "o80/base/time.hpp"             // iterations and nanoseconds
#include "o80/describe/describe.hpp"     // O80_DESCRIBE: structs that describe themselves
#include "o80/describe/schema.hpp"       // the schema of a robot
#include "o80/robot/driver.hpp"          // the driver class to be written
#include "o80/robot/make_table.hpp"      // O80_ROBOT: that class as a shared library
#include "o80/robot/plant_requests.hpp"  // reset, snapshot, restore
