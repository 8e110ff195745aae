#pragma once

#include <array>
#include <cstdint>
#include <string>

namespace o80::test {

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define O80_SANITIZED
#elif defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer)
#define O80_SANITIZED
#endif
#endif

/// A sanitizer intercepts and calls for itself: nothing can be told there.
#ifdef O80_SANITIZED
inline constexpr bool kCallsAreIntercepted = false;
#else
inline constexpr bool kCallsAreIntercepted = true;
#endif

/// Kinds of library calls that no iteration makes.
enum class Kind : std::uint8_t { heap, lock, exception, text, count };

inline constexpr std::size_t kKinds = static_cast<std::size_t>(Kind::count);
inline constexpr std::size_t kSystemCalls = 512;

/// What a thread called while it was watched.
struct Calls {
  std::array<std::uint32_t, kKinds> of{};
  std::array<const char*, kKinds> last{};  // names
  std::array<std::uint32_t, kSystemCalls> system{};
  std::uint32_t wakes = 0;  // of the futex calls
  std::uint32_t waits = 0;  // the same

  std::uint32_t operator[](Kind kind) const { return of[static_cast<std::size_t>(kind)]; }
  std::uint32_t system_calls() const;
  /// All of it by name, for messages: "" if nothing was called.
  std::string text() const;
};

/// What was called between two moments.
Calls operator-(const Calls& later, const Calls& earlier);

/// Of the calling thread, since it was first watched.
const Calls& calls_so_far() noexcept;

/// Counts library and system calls of the calling thread while it lives. The system calls are
/// stopped at the kernel's door (syscall user dispatch), counted, and made after all.
class Watched {
 public:
  Watched() noexcept;
  Watched& operator=(Watched&&) = delete;
  ~Watched();
};

/// Whether this machine's kernel lets system calls be counted.
bool system_calls_are_counted();

}  // namespace o80::test
