#pragma once

#include <cstdlib>
#include <string>

namespace o80::test {

/// How many random cases a test plays: O80_CASES times the usual number, under a sanitizer a fifth.
template <class Number>
Number cases(Number usual) {
#ifdef O80_TEST_SANITIZED
  usual = (usual + 4) / 5;
#endif
  const char* times = std::getenv("O80_CASES");
  return times == nullptr ? usual : usual * static_cast<Number>(std::stoul(times));
}

}  // namespace o80::test
