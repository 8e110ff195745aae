#pragma once

#include <cstdint>

namespace o80 {

/// Rights of a frontend to a segment.
enum class Access : std::uint8_t {
  read_only,  // observe
  read_write  // observe and command
};

}  // namespace o80
