#pragma once

#include <cstdint>

namespace o80 {

/// What the backend says of itself (superseded is said by its successor).
enum class BackendState : std::uint32_t { starting, running, stopped, failed, superseded };

/// What is true of it: the word above and the kernel's lock together.
enum class Life { starting, running, stopped, failed, superseded, killed };
const char* name_of(Life life) noexcept;
/// Neither starting nor running, for good.
constexpr bool is_over(Life life) noexcept {
  return life != Life::starting && life != Life::running;
}

}  // namespace o80
