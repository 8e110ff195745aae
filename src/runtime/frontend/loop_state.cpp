#include "runtime/frontend/loop_state.hpp"

#include <algorithm>
#include <cstdio>

#include "memory/os/process_start.hpp"
#include "memory/segment/queue_word.hpp"
#include "o80/runtime/frontend.hpp"
#include "runtime/frontend/link.hpp"

namespace o80 {

namespace {

constexpr std::int64_t kSecond = 1'000'000'000;

std::string number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, value < 100.0 ? "%.3g" : "%.0f", value);
  return text;
}

std::string seconds(std::int64_t nanoseconds) {
  return std::to_string(nanoseconds / kSecond) + " s";
}

}  // namespace

bool LoopState::stalled() const noexcept {
  return row_age.has_value() && *row_age > kSecond + 2 * period;
}

std::string LoopState::hang() const {
  if (played) return "";  // a recording may end, or have gaps
  const std::string process = "its process (pid " + std::to_string(pid) + ")";
  std::string text;
  // a verb begins after the row before it, and the helper thread notes it somewhat later
  const std::int64_t longest = stalled() ? *row_age / 2 : kSecond + (bursting ? 0 : 2 * period);
  const bool hangs = slow_verb != Verb::none && slow_for > longest;
  if (stalled()) text = "no row for " + seconds(*row_age);
  if (process_stopped) {
    text += text.empty() ? "" : ": ";
    text += process + " is stopped, continue it with `kill -CONT " + std::to_string(pid) + "`";
  } else if (hangs) {
    text += text.empty() ? "" : ": ";
    text += std::string(to_text(slow_verb)) + "() of the driver has been running for " +
            seconds(slow_for);
  } else if (stalled()) {
    text += ": " + process + " gets no processor time, or its program no longer calls o80";
  }
  return text;
}

const char* LoopState::word() const {
  return SegmentState{.life = life, .hangs = !hang().empty(), .halted = halted, .played = played}
      .word();
}

std::string LoopState::trouble() const {
  std::string hangs = hang();
  if (!hangs.empty()) return hangs;
  if (recent_overruns == 0 || !rate) return queue;
  return late_text(recent_overruns, recent_rows, *rate, period);
}

std::string late_text(std::uint32_t overruns, std::uint32_t rows, double rate,
                      std::int64_t period) {
  return std::to_string(overruns) + " of the last " + std::to_string(rows) +
         " iterations were late or missed their tick: " + number(rate) + " Hz reached of " +
         number(1e9 / static_cast<double>(period));
}

LoopState loop_state(const UntypedFrontend& frontend, std::int64_t now) {
  LoopState state;
  const AttachedSegment& segment = frontend.link()->segment;
  state.life = frontend.life();
  state.pid = segment.header().pid;
  state.bursting = frontend.bursting();
  state.halted = frontend.halted().has_value();
  state.played = is_played(segment);
  state.period = frontend.period();
  state.last = frontend.published();
  if (!is_over(state.life)) {
    const SlowVerb slow = slow_verb(segment.view());
    state.slow_verb = slow.verb;
    state.slow_for = slow.verb == Verb::none ? 0 : now - slow.since;
    const std::optional<QueueHolder> holder = queue_holder(segment.view());
    if (holder && !holder->bursts && state.last - holder->since >= kLongQueue) {
      state.queue = frontend.link()->queue_text();
    }
    const ProcessState process = process_state(state.pid);
    state.process_stopped = process.start == segment.header().process_start &&
                            (process.letter == 'T' || process.letter == 't');
  }

  UntypedObservation row(frontend.description());
  const HistoryReader& history = frontend.link()->history;
  if (state.last < 0 || !history.read(state.last, row.bytes())) return state;
  const RowHead last = row.head();
  state.overruns = last.overruns;
  state.skipped = last.skipped;
  state.starvations = last.starvations;
  if (frontend.schema().head.clock == Clock::simulated) return state;
  state.row_age = now - last.time;
  // the oldest row that is at most a second older, or the one before
  const Iteration within = frontend.iteration_at(last.time - kSecond - 1) + 1;
  if (!history.read(std::min(within, last.iteration - 1), row.bytes())) return state;
  const RowHead first = row.head();
  if (first.time >= last.time) return state;
  state.recent_rows = static_cast<std::uint32_t>(last.iteration - first.iteration);
  state.recent_overruns = last.overruns - first.overruns;
  state.rate =
      static_cast<double>(state.recent_rows) * 1e9 / static_cast<double>(last.time - first.time);
  if (state.stalled()) state.rate = 0.0;
  return state;
}

}  // namespace o80
