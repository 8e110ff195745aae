#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "o80/memory/life.hpp"

namespace o80 {

struct SegmentEntry {
  std::string name;
  Life life = Life::unknown;
  bool readable = false;  // false: another version, no permission, or an owner without trust
  int pid = 0;
  std::uint64_t process_start = 0;  // as from process_start()
  std::int64_t started_at = 0;      // [s] since 1970
  std::string user{};
  std::string program{};
  std::uint64_t epoch = 0;
  std::uint64_t bytes = 0;  // size of both files
  bool halted = false;
  bool played = false;    // a recording is played into it
  std::string problem{};  // reason if not readable

  /// State as a text; rows are not read, so that a hanging backend counts as running.
  const char* state() const noexcept;
};

/// All segments of the directory, sorted by name.
std::vector<SegmentEntry> list_segments();

/// Removes a dead segment; false if there is none. Throws SegmentTaken if it is alive.
bool clean(std::string_view name);

/// Removes all dead segments, and leftover files of killed starters and cleaners. Returns
/// the removed names.
std::vector<std::string> clean_dead();

}  // namespace o80
