#pragma once

#include <string_view>

/// Version of these headers, "major.minor.patch". CMake reads it from this line; pyproject.toml
/// must have the same.
#define O80_VERSION "0.1.0"

namespace o80 {

/// The version of the compiled library, "major.minor.patch".
std::string_view version() noexcept;

}  // namespace o80
