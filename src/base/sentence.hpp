#pragma once

#include <string>

namespace o80 {

/// A text with its full stop, if it does not end a sentence already: another sentence follows.
inline std::string sentence(std::string text) {
  const bool ends = !text.empty() && std::string(".!?").find(text.back()) != std::string::npos;
  return ends ? text : text + ".";
}

}  // namespace o80
