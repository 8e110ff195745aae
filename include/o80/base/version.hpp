#pragma once

#include <string_view>

namespace o80 {

/// The version of the compiled library, "major.minor.patch".
std::string_view version() noexcept;

}  // namespace o80
