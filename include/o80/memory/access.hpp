#pragma once

#include <cstdint>

namespace o80 {

/// What a frontend may do with a segment.
enum class Access : std::uint8_t {
  read_only,  // observe
  read_write  // command as well
};

}  // namespace o80
