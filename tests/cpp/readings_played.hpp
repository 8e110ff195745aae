#pragma once

#include <cstdlib>
#include <string>

namespace o80::test {

/// How many random readings a property test plays: O80_READINGS times the usual number.
inline int readings_played(int usual) {
  const char* times = std::getenv("O80_READINGS");
  return times == nullptr ? usual : usual * std::stoi(times);
}

}  // namespace o80::test
