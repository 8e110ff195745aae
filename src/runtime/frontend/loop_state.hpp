#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "memory/segment/verb_word.hpp"
#include "o80/base/time.hpp"
#include "o80/memory/life.hpp"

namespace o80 {

class UntypedFrontend;

/// A queue of batches is reported from this age on [iterations].
inline constexpr Iteration kLongQueue = 10;

/// State of a backend's loop, from its rows and counters.
struct LoopState {
  Life life = Life::unknown;
  int pid = 0;
  bool process_stopped = false;  // by SIGSTOP or a debugger
  bool bursting = false;
  bool halted = false;
  bool played = false;           // its rows come from a recording
  std::int64_t period = 0;       // [ns]
  Iteration last = -1;           // the newest row; -1: none yet
  std::uint32_t overruns = 0;    // so far
  std::uint32_t skipped = 0;     // periods skipped, or ticks of the robot missed, so far
  std::int64_t starvations = 0;  // RowHead::starvations

  // over the last second of rows, or the last two rows; nothing in simulated time
  std::optional<double> rate;  // reached [1/s]; 0: stalled
  std::uint32_t recent_rows = 0;
  std::uint32_t recent_overruns = 0;

  std::optional<std::int64_t> row_age;  // of the newest row [ns]; nothing in simulated time
  Verb slow_verb = Verb::none;          // a call into the driver that has not returned
  std::int64_t slow_for = 0;            // [ns]

  /// The frontend for whose batches others have waited for kLongQueue iterations; empty: none.
  std::string queue;

  /// True if no row was published for longer than a second and two periods.
  bool stalled() const noexcept;
  /// Reason why no row is published although one is due; empty if rows are published.
  std::string hang() const;
  /// The state of the segment for a text.
  const char* word() const;
  /// hang(), or else recent overruns with the rate that is reached, or else the queue; empty if
  /// there is no trouble.
  std::string trouble() const;
};

/// "303 of the last 304 iterations were late or missed their tick: 99 Hz reached of 1000"
std::string late_text(std::uint32_t overruns, std::uint32_t rows, double rate, std::int64_t period);

/// Reads a few rows; throws Closed, UsedAfterFork.
LoopState loop_state(const UntypedFrontend& frontend, std::int64_t now = monotonic_now());

}  // namespace o80
