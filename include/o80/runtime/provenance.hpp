#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

namespace o80 {

/// Provenance of a backend: all that is needed to start the same robot again. Stored in the
/// segment from the moment when the segment has its name.
struct Provenance {
  /// Names and texts of options, with which the same robot can be started.
  using Options = std::vector<std::pair<std::string, std::string>>;

  /// File named by an option of the robot.
  struct File {
    std::string option;
    std::string path;    // absolute
    std::string sha256;  // of the content, as printed by `sha256sum`; empty: not read
    bool operator==(const File&) const = default;
  };

  std::string robot{};           // name for `o80 run`
  std::string library{};         // absolute path of the robot's library or program; may be empty
  std::string library_sha256{};  // of the content
  std::string built_with{};      // versions of the libraries in the robot's build
  Options options{};             // of the robot's Config, with defaults and drawn seeds
  Options run_options{};         // of the backend and its loop, with defaults
  std::vector<File> files{};
  std::string version{};      // of o80
  std::string source_hash{};  // of the sources of the o80 that ran the robot
  /// Offset from a row's time to wall-clock time, in ns since 1970. Measured at the start: the
  /// clocks may drift apart, or be set, while the backend runs.
  std::int64_t wall_clock_offset = 0;
  /// Version of the rules that convert commands to desired states; changes with the rules.
  std::int64_t motion_rules = 1;

  bool operator==(const Provenance&) const = default;
};

}  // namespace o80
