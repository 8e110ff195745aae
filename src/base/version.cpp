#include "o80/base/version.hpp"

namespace o80 {

std::string_view version() noexcept { return O80_VERSION; }

}  // namespace o80
