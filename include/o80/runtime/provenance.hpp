#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

namespace o80 {

/// How a backend was started: what is needed to start the same robot again. It is stored in the
/// segment, which holds it from the moment it has its name.
struct Provenance {
  /// Names and texts of options, with which the same robot can be started.
  using Options = std::vector<std::pair<std::string, std::string>>;

  /// A file that an option of the robot names.
  struct File {
    std::string option;
    std::string path;    // absolute
    std::string sha256;  // of its content, as `sha256sum` prints it; empty: not read
    bool operator==(const File&) const = default;
  };

  std::string robot{};           // name, as `o80 run` takes it
  std::string library{};         // absolute path of the robot's library or program; may be empty
  std::string library_sha256{};  // of its content
  std::string built_with{};      // versions of what the robot was built with
  Options options{};             // of the robot's Config, with defaults and drawn seeds
  Options run_options{};         // of the backend and its loop, with defaults
  std::vector<File> files{};
  std::string version{};      // of o80
  std::string source_hash{};  // of the sources of the o80 that ran it
  /// A row's time plus this is wall-clock time, in ns since 1970. As of the start: the clocks may
  /// drift apart, or be set, while the backend runs.
  std::int64_t wall_clock_offset = 0;
  /// Version of the rules that make desired states of commands. It changes when o80 changes them.
  std::int64_t motion_rules = 1;

  bool operator==(const Provenance&) const = default;
};

}  // namespace o80
