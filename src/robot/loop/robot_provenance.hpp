#pragma once

#include "o80/runtime/provenance.hpp"
#include "robot/driver/driver_instance.hpp"
#include "robot/loop/loop_options.hpp"

namespace o80 {

/// What is known of a robot that is started with these options: name, library, options, and the
/// files that they name. `options`: as effective_options() gives them.
Provenance provenance_of(const RobotTable& table, const OptionValues& options);

/// For a table that is in no library. `path`: the file that holds its driver; `name`: what the
/// provenance calls it (FILE.py:Class).
void name_library(const RobotTable& table, const std::string& path, const std::string& name);

/// The real-time options of a robot's process, as names and texts of loop options.
Provenance::Options texts_of(const RealTimeOptions& options);

}  // namespace o80
