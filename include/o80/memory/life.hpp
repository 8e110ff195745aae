#pragma once

#include <cstdint>

namespace o80 {

/// State of a backend as stored in its segment; `superseded` is stored by its successor.
enum class BackendState : std::uint32_t { starting, running, stopped, failed, superseded };

/// State of a backend as a reader decides it, from the stored state and the lock of the backend: a
/// free lock without a stored end means that the process was killed. It is unknown if the segment
/// cannot be read.
enum class Life { starting, running, stopped, failed, superseded, killed, unknown };
const char* name_of(Life life) noexcept;
/// True if the backend has ended. An end is final.
constexpr bool is_over(Life life) noexcept {
  return life != Life::starting && life != Life::running && life != Life::unknown;
}

/// State of a segment as every text names it.
struct SegmentState {
  Life life = Life::unknown;
  bool hangs = false;
  bool halted = false;
  bool played = false;  // a recording is played into it

  /// Its Life in a word; hangs, halted or played for a backend that runs or starts.
  const char* word() const noexcept;
};

}  // namespace o80
