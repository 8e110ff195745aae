#pragma once

#include <string_view>

/// Version of these headers, "major.minor.patch". CMake reads it from this line; pyproject.toml
/// must have the same.
#define O80_VERSION "0.1.0"

namespace o80 {

/// The version of the compiled library, "major.minor.patch".
std::string_view version() noexcept;

/// SHA-256 of the library's sources, in hexadecimal: equal for builds of the same sources.
/// Computed by cmake/source_hash.cmake.
std::string_view source_hash() noexcept;

}  // namespace o80
