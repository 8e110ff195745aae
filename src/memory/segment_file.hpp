#pragma once

#include <sys/types.h>

#include <atomic>
#include <cstdint>
#include <string>

#include "memory/segment_layout.hpp"
#include "o80/memory/life.hpp"

namespace o80 {

/// True if `path` names the very file behind the descriptor.
bool leads_to(const std::string& path, int descriptor) noexcept;

/// True if it begins as a segment of any version.
bool bears_the_mark(int descriptor) noexcept;

/// As it stands in the file, unchecked; false if it is truncated.
bool read_header(int descriptor, SegmentHeader& header) noexcept;

/// The epoch of a segment of this version; 0 of anything else.
std::uint64_t epoch_of(int descriptor) noexcept;

/// Reads and checks a header; what is wrong with the file, or an empty text.
std::string inspect_segment(int descriptor, SegmentHeader& header, SegmentOffsets& offsets);

/// What is wrong with the commanders' file of a segment, or an empty text.
std::string inspect_commands(int commands, int segment, const SegmentHeader& header,
                             const SegmentOffsets& offsets);

/// Who may observe, by the read bits of a permission: the mode of the segment file. Whoever may
/// command may observe too.
mode_t observers_mode(mode_t permission) noexcept;
/// Who may command, by the write bits: the mode of the commanders' file.
mode_t commanders_mode(mode_t permission) noexcept;

/// What the state word and the lock say together. `descriptor` must bear no lock itself; observers
/// ask about the segment file, commanders about theirs.
Life judge_life(int descriptor, const std::atomic<std::uint32_t>& state) noexcept;

/// Sets the state and wakes all who wait, if the view has the commanders' file.
void end_segment(const SegmentView& view, BackendState state) noexcept;

/// "pid 4711, started 14:02 by ada".
std::string describe_owner(const SegmentHeader& header);

/// The name of this user and of this program, cut to what fits.
std::string own_user();
std::string own_program();
/// "pid 4711 (python)".
std::string own_process();

}  // namespace o80
