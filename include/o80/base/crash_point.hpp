#pragma once

/// A named place at which a test may kill the process, to prove that nothing breaks there.
///
/// Compiles to nothing unless O80_CRASH_POINTS is defined. Then the process kills itself (SIGKILL)
/// when it passes the point named by the environment variable O80_CRASH_AT, "label" or "label:n"
/// for the n-th passage.
#ifdef O80_CRASH_POINTS

#include <signal.h>

#include <atomic>
#include <cstdlib>
#include <cstring>
#include <string>

namespace o80 {

inline void pass_crash_point(const char* label) noexcept {
  static std::atomic<long> passages{0};
  const char* target = std::getenv("O80_CRASH_AT");
  if (target == nullptr) return;
  const std::size_t length = std::strlen(label);
  if (std::strncmp(target, label, length) != 0) return;
  if (target[length] != '\0' && target[length] != ':') return;
  const long wanted = target[length] == ':' ? std::atol(target + length + 1) : 1;
  if (passages.fetch_add(1) + 1 == wanted) raise(SIGKILL);
}

}  // namespace o80

#define O80_CRASH_POINT(label) ::o80::pass_crash_point(label)
#else
#define O80_CRASH_POINT(label) static_cast<void>(0)
#endif
