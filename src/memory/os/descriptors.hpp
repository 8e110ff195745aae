#pragma once

namespace o80 {

/// Opens /dev/null on each of the descriptors 0, 1 and 2 that is closed: the next file would get
/// its number, and messages would be written into that file. For programs, before they open
/// anything; a library does not change the descriptors of its host.
void open_standard_descriptors() noexcept;

/// The descriptor, or in place of 0, 1 or 2 a higher one of the same open file; -1 stays -1.
int above_standard(int descriptor) noexcept;

}  // namespace o80
