#include "robot/loop/loop_report.hpp"

#include <pthread.h>

#include <algorithm>
#include <cstdio>
#include <exception>
#include <utility>

#include "base/signals_blocked.hpp"
#include "memory/os/futex.hpp"
#include "o80/base/time.hpp"
#include "o80/runtime/frontend.hpp"
#include "robot/loop/service_manager.hpp"

namespace o80 {

namespace {
constexpr std::int64_t kReportPeriod = 1'000'000'000;   // between two looks [ns]
constexpr std::int64_t kBetweenLines = 10'000'000'000;  // about late iterations [ns]

void say(const std::string& text) { std::fprintf(stderr, "o80: %s\n", text.c_str()); }

/// What lasts, so that it is the status of the service too.
void say_state(const std::string& text) {
  say(text);
  notify_service_manager("STATUS=" + text);
}
}  // namespace

std::optional<std::string> OverrunReport::poll(const RowHead& row, std::int64_t now) {
  if (!first_ || row.overruns == first_->overruns) {
    first_ = row;
    return std::nullopt;
  }
  if (said_at_ != 0 && now - said_at_ < kBetweenLines) return std::nullopt;
  said_at_ = now;
  const RowHead before = *std::exchange(first_, row);
  const auto rows = static_cast<std::uint32_t>(row.iteration - before.iteration);
  const double rate =
      rows * 1e9 / static_cast<double>(std::max<std::int64_t>(row.time - before.time, 1));
  return late_text(row.overruns - before.overruns, rows, rate, period_) + ", " +
         std::to_string(row.skipped - before.skipped) +
         " periods were skipped. `o80 doctor` reports the causes on this computer; see "
         "docs/real_time.md, or lower --frequency";
}

std::optional<std::string> HangReport::poll(const LoopState& loop, std::int64_t now) {
  std::string text = loop.hang();
  if (text.empty()) {
    return std::exchange(hangs_, false) ? std::optional("the loop continues") : std::nullopt;
  }
  if (hangs_ && now - said_at_ < kBetweenLines) return std::nullopt;
  hangs_ = true;
  said_at_ = now;
  return text;
}

LoopReport::LoopReport(std::string segment) : segment_(std::move(segment)) {
  const SignalsBlocked blocked;
  thread_ = std::thread([this] { run(); });
  const sched_param ordinary{};
  pthread_setschedparam(thread_.native_handle(), SCHED_OTHER, &ordinary);
}

LoopReport::~LoopReport() {
  stop_.store(1, std::memory_order_seq_cst);
  futex_wake(stop_, kEverybody);
  thread_.join();
}

void LoopReport::run() noexcept {
  try {
    // the loop may have ended before this thread began: then stop waiting for its segment
    const KeepWaiting continues = [this] { return stop_.load(std::memory_order_acquire) == 0; };
    // attach before row 0, so that a start() that hangs is reported too
    const UntypedFrontend watcher(
        segment_,
        {.timeout = {}, .access = Access::read_only, .starting = true, .keep_waiting = continues});
    OverrunReport overruns(watcher.period());
    HangReport hangs;
    std::uint64_t halted = 0;
    bool has_starved = false;
    while (stop_.load(std::memory_order_acquire) == 0) {
      const std::int64_t moment = monotonic_now();
      if (const auto line = hangs.poll(loop_state(watcher, moment), moment)) say(*line);
      if (watcher.published() >= 0) {
        const RowHead row = watcher.latest().head();
        if (const auto line = overruns.poll(row, moment)) say(*line);
        if (row.starvations > 0 && !std::exchange(has_starved, true)) {
          say("a plan of chunks ran out of rows: its policy answers too late, or did not close "
              "the plan. This is reported once; `o80 info " +
              segment_ + "` has the count, and rows are marked `starved` (docs/chunks.md)");
        }
      }
      const std::optional<Halt> halt = watcher.halted();
      const std::uint64_t now = halt ? halt->number : 0;
      if (now != halted && halt) say_state("halted in " + halt_text(*halt));
      if (now != halted && !halt) say_state("resumed");
      halted = now;
      futex_wait(stop_, 0, kReportPeriod);
    }
  } catch (const std::exception&) {
    return;  // the backend has ended: there is nothing left to report
  }
}

}  // namespace o80
