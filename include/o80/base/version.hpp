#pragma once

#include <string_view>

/// Version of these headers, "major.minor.patch". CMake reads it from this line; pyproject.toml
/// must have the same.
#define O80_VERSION "0.1.0"

namespace o80 {

/// The version of the compiled library, "major.minor.patch".
std::string_view version() noexcept;

/// SHA-256 of the sources that the library was compiled from, in hexadecimal: two builds of the
/// same sources have the same. Made by cmake/source_hash.cmake.
std::string_view source_hash() noexcept;

}  // namespace o80
