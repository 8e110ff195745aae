#pragma once

#include <cstdint>

namespace o80 {

/// State of a backend as stored in its segment; `superseded` is stored by its successor.
enum class BackendState : std::uint32_t { starting, running, stopped, failed, superseded };

/// State of a backend derived by a reader from the stored state and the backend's lock: a free
/// lock without a stored end means that the process was killed. Unknown if the segment
/// cannot be read.
enum class Life { starting, running, stopped, failed, superseded, killed, unknown };
// its first values are those that are stored
static_assert(static_cast<int>(Life::superseded) == static_cast<int>(BackendState::superseded));
const char* name_of(Life life) noexcept;
/// True if the backend has ended. An end is final.
constexpr bool is_over(Life life) noexcept {
  return life != Life::starting && life != Life::running && life != Life::unknown;
}

/// State of a segment, as named in all texts.
struct SegmentState {
  Life life = Life::unknown;
  bool hangs = false;
  bool halted = false;
  bool played = false;  // a recording is played into it

  /// Derives the state from the Life; hangs, halted or played for a running or starting backend.
  const char* word() const noexcept;
};

}  // namespace o80
