#pragma once

#include <string_view>

/// Of these headers, "major.minor.patch"; CMake reads it here, pyproject.toml says the same.
#define O80_VERSION "0.1.0"

namespace o80 {

/// The version of the compiled library, "major.minor.patch".
std::string_view version() noexcept;

}  // namespace o80
