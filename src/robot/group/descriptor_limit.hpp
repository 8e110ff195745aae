#pragma once

#include <cstddef>
#include <string>

namespace o80 {

/// Makes sure that the process may open `more` files besides those that are open: raises its soft
/// limit (RLIMIT_NOFILE) if necessary. Throws Error if the hard limit is too low; `what` needs the
/// files.
void allow_descriptors(std::size_t more, const std::string& what);

}  // namespace o80
