#pragma once

// All that a robot library needs: descriptions, the driver, its table. No frontend, no backend.

#include "o80/base/error.hpp"            // what can go wrong
#include "o80/base/time.hpp"             // iterations and nanoseconds
#include "o80/describe/describe.hpp"     // O80_DESCRIBE: structs that describe themselves
#include "o80/describe/schema.hpp"       // what a robot is made of
#include "o80/robot/driver.hpp"          // the class an engineer writes
#include "o80/robot/make_table.hpp"      // O80_ROBOT: that class as a shared library
#include "o80/robot/plant_requests.hpp"  // reset, snapshot, restore
