#pragma once

// o80's headers in reading order.

#include "o80/memory/segment_list.hpp"     // list of segments
#include "o80/robot.hpp"                   // all headers of a robot library
#include "o80/robot/real_time.hpp"         // scheduling and processors of a thread
#include "o80/robot/run.hpp"               // a robot as a program
#include "o80/runtime/journal.hpp"         // decisions of a backend: batches, senders, ends
#include "o80/runtime/typed_backend.hpp"   // a backend inside a program
#include "o80/runtime/typed_frontend.hpp"  // commands and observations
