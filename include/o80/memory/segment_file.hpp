#pragma once

#include <atomic>
#include <cstdint>
#include <string>

#include "o80/memory/life.hpp"
#include "o80/memory/segment_layout.hpp"

namespace o80 {

/// True if `path` names the very file behind the descriptor.
bool leads_to(const std::string& path, int descriptor) noexcept;

/// True if it begins as a segment of any version.
bool bears_the_mark(int descriptor) noexcept;

/// True if somebody holds byte 0 and goes on holding it, and `path` still names this file.
///
/// Waits a moment for those who hold it in passing: a cleaner, a starter, a dying process. The
/// descriptor must bear no lock itself.
bool is_held(int descriptor, const std::string& path);

/// What refuses a second backend.
std::string taken_text(std::string_view name, int descriptor);

/// Reads and checks a header; what is wrong with the file, or an empty text.
std::string inspect_segment(int descriptor, SegmentHeader& header, SegmentOffsets& offsets);

/// What the state word and the lock say together; `descriptor` must bear no lock itself.
Life judge_life(int descriptor, const std::atomic<std::uint32_t>& state) noexcept;

/// Sets the state and wakes all who wait in this segment.
void end_segment(const SegmentView& view, State state) noexcept;

/// "pid 4711, started 14:02 by ada".
std::string describe_owner(const SegmentHeader& header);

/// The name of this user and of this program, cut to what fits.
std::string own_user();
std::string own_program();

}  // namespace o80
