#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace o80 {

/// The directory of all segments: the environment variable O80_DIRECTORY, else /dev/shm.
std::string segment_directory();
/// Why segments there cannot be listed, and what to do; empty if the directory can be read.
std::string directory_problem();

/// 1 to 64 of [A-Za-z0-9_.-], not starting with '.', without ".new-" and ".commanders-".
bool is_segment_name(std::string_view name) noexcept;

/// Throws InvalidArgument if is_segment_name() is false.
void check_segment_name(std::string_view name);

// The files of a segment, in the directory above. Each function checks the name.
//
//   o80-arm                              the segment file
//   o80-arm.commanders-0123456789abcdef  the commanders' file of an epoch
//   o80-arm.new-0123456789abcdef         the draft of the segment file of an epoch

std::string segment_path(std::string_view name);
std::string commands_path(std::string_view name, std::uint64_t epoch);
std::string draft_path(std::string_view name, std::uint64_t epoch);

/// The parts of the name of such a file.
struct SegmentFileName {
  enum class Kind { segment, commands, draft };
  Kind kind = Kind::segment;
  std::string name;         // name of the segment
  std::uint64_t epoch = 0;  // 0 for a segment file
};

/// Empty if this is not the name of a file of a segment.
std::optional<SegmentFileName> parse_file_name(std::string_view file);

/// All files of segments in that directory, sorted. `error`: gets the number of a failure to read
/// it; 0 also if it is missing or not for this user.
std::vector<SegmentFileName> list_files(int* error = nullptr);

}  // namespace o80
