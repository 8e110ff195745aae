#pragma once

// o80's headers in reading order.

#include "o80/base/error.hpp"              // what can go wrong
#include "o80/base/time.hpp"               // iterations and nanoseconds
#include "o80/describe/describe.hpp"       // O80_DESCRIBE: structs that describe themselves
#include "o80/describe/schema.hpp"         // what a robot is made of
#include "o80/memory/segment_list.hpp"     // which segments there are
#include "o80/robot/driver.hpp"            // the class an engineer writes
#include "o80/robot/make_table.hpp"        // O80_ROBOT: that class as a shared library
#include "o80/robot/plant_requests.hpp"    // reset, snapshot, restore
#include "o80/robot/real_time.hpp"         // scheduling and processors of a thread of one's own
#include "o80/robot/run.hpp"               // or as a program of its own
#include "o80/runtime/typed_backend.hpp"   // a backend inside one's own program
#include "o80/runtime/typed_frontend.hpp"  // the side that commands and reads
