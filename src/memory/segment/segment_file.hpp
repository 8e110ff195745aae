#pragma once

#include <sys/types.h>

#include <atomic>
#include <cstdint>
#include <string>
#include <vector>

#include "memory/segment/segment_layout.hpp"
#include "o80/memory/life.hpp"

namespace o80 {

/// True if `path` leads to the file of the descriptor.
bool is_path_of(const std::string& path, int descriptor) noexcept;

/// Names of open files. The files can be removed or replaced, or a file system can be mounted over
/// their directory: then the names lead elsewhere.
struct FileNames {
  struct Name {
    std::string path;
    int descriptor = -1;
  };
  std::vector<Name> names{};

  bool are_replaced() const noexcept;
};

/// True if the file starts with the magic number of a segment, of any version.
bool has_magic(int descriptor) noexcept;

/// Reads the header without a check; false if the file is too short.
bool read_header(int descriptor, SegmentHeader& header) noexcept;

/// The epoch of a segment of this version; 0 for any other file.
std::uint64_t epoch_of(int descriptor) noexcept;

/// Reads and checks the header of a segment file. Returns the fault of the file, or an empty text.
std::string inspect_segment(int descriptor, SegmentHeader& header, SegmentOffsets& offsets);

/// Checks the commanders' file of a segment. Returns its fault, or an empty text.
std::string inspect_commands(int commands, int segment, const SegmentHeader& header,
                             const SegmentOffsets& offsets);

/// The mode of the segment file for a permission: its read bits say who may observe. Users that may
/// command may observe too.
mode_t observers_mode(mode_t permission) noexcept;
/// The mode of the commanders' file for a permission: its write bits say who may command.
mode_t commanders_mode(mode_t permission) noexcept;

/// Decides the Life of a backend from its state word and the lock of its byte. `descriptor` must
/// not hold the lock itself. It is the segment file for observers, else the commanders' file
/// (src/memory/README.md#locks).
Life life_of(int descriptor, const std::atomic<std::uint32_t>& state) noexcept;

/// Stores the end, and wakes all waiters if the view has the commanders' file.
void end_segment(const SegmentView& view, BackendState state) noexcept;

/// "pid 4711, started 14:02 by ada".
std::string describe_owner(const SegmentHeader& header);

/// The name of this user; the name of this program, cut to 63 bytes.
std::string own_user();
std::string own_program();
/// "pid 4711 (python)".
std::string own_process();

}  // namespace o80
