#pragma once

#include <string>
#include <string_view>

namespace o80 {

/// Makes a text from shared memory safe for a terminal: bytes other than printable ASCII become
/// question marks.
inline std::string printable(std::string_view text) {
  std::string clean(text);
  for (char& c : clean)
    if (c < ' ' || c > '~') c = '?';
  return clean;
}

}  // namespace o80
