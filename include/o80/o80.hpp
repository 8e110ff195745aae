#pragma once

// o80's headers in reading order.

#include "o80/memory/segment_list.hpp"     // which segments there are
#include "o80/robot.hpp"                   // all that a robot library needs
#include "o80/robot/real_time.hpp"         // scheduling and processors of a thread of one's own
#include "o80/robot/run.hpp"               // a robot as a program of its own
#include "o80/runtime/journal.hpp"         // what a backend decided: who sent what, when it ended
#include "o80/runtime/typed_backend.hpp"   // a backend inside one's own program
#include "o80/runtime/typed_frontend.hpp"  // the side that commands and reads
