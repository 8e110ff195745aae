#pragma once

#include <string>
#include <string_view>

namespace o80 {

/// Where segments live: the environment variable O80_DIRECTORY, else /dev/shm.
std::string segment_directory();

/// 1 to 64 of [A-Za-z0-9_.-], not starting with '.', without ".new-".
bool is_segment_name(std::string_view name) noexcept;

/// Throws InvalidArgument unless it is one.
void check_segment_name(std::string_view name);

/// The file of a segment; checks the name.
std::string segment_path(std::string_view name);

}  // namespace o80
