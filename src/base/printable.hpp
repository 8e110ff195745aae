#pragma once

#include <string>
#include <string_view>

namespace o80 {

/// A text from memory that others write, fit for a terminal: bytes that are no printable ASCII
/// become question marks.
inline std::string printable(std::string_view text) {
  std::string clean(text);
  for (char& c : clean)
    if (c < ' ' || c > '~') c = '?';
  return clean;
}

}  // namespace o80
