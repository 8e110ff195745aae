#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace o80 {

/// Where segments live: the environment variable O80_DIRECTORY, else /dev/shm.
std::string segment_directory();

/// 1 to 64 of [A-Za-z0-9_.-], not starting with '.', without ".new-" and ".commanders-".
bool is_segment_name(std::string_view name) noexcept;

/// Throws InvalidArgument unless it is one.
void check_segment_name(std::string_view name);

// The files of a segment, in the directory above. Each function checks the name.
//
//   o80-arm                              the segment file
//   o80-arm.commanders-0123456789abcdef  the commanders' file of that epoch
//   o80-arm.new-0123456789abcdef         the segment file of that epoch, until it is complete

std::string segment_path(std::string_view name);
std::string commands_path(std::string_view name, std::uint64_t epoch);
std::string draft_path(std::string_view name, std::uint64_t epoch);

/// What the name of a file in that directory says.
struct SegmentFileName {
  enum class Kind { segment, commands, draft };
  Kind kind = Kind::segment;
  std::string name;         // of the segment
  std::uint64_t epoch = 0;  // of commands and draft
};

/// Nothing if no file of a segment is called so.
std::optional<SegmentFileName> parse_file_name(std::string_view file);

/// All files of segments in that directory, sorted.
std::vector<SegmentFileName> list_files();

}  // namespace o80
