#include "runtime/backend/halts.hpp"

#include <algorithm>

#include "base/short_text.hpp"
#include "o80/describe/schema_bytes.hpp"
#include "runtime/backend/backend_options.hpp"
#include "runtime/journal/recorded_decisions.hpp"

namespace o80 {

namespace {
constexpr std::uint32_t kScheduledPerIteration = 256;  // scheduled batches that a halt ends
}  // namespace

Halts::Halts(BackendCore& core, Bursts& bursts, Readings& readings, const BackendOptions& options)
    : core_(core),
      bursts_(bursts),
      readings_(readings),
      latch_(core.segment.view()),
      errors_(core.schema),
      overruns_(options.max_overruns),
      gaps_(core.recorded == nullptr ? longest_gap(core.schema, options) : 0) {}

void Halts::request(HaltCause cause, std::string_view text) noexcept {
  std::atomic<std::uint64_t>& last = requested_[static_cast<std::size_t>(cause)];
  const std::uint64_t print = describing::hash_of(std::as_bytes(std::span(text))) | 1;  // not 0
  if (last.exchange(print, std::memory_order_relaxed) == print) return;
  if (core_.recorded != nullptr) return core_.recorded->ask_to_halt(cause, text);
  request_halt(core_.segment.view(), cause, {}, text);
}

void Halts::set_timing(const Timing& now) noexcept {
  const std::uint32_t late = now.overruns - core_.timing.overruns;
  core_.timing = now;
  if (late == 0 || !overruns_.exceeded(monotonic_now())) return;
  ShortText<120> text;
  text.add(overruns_.most())
      .add(" iterations within a second were late or missed their tick: --max-overruns");
  request(HaltCause::overruns, text.view());
}

void Halts::find_excess() noexcept {
  const auto excess = errors_.find(core_.controller.desired(), core_.row() + core_.layout.observed);
  if (!excess) return;
  ShortText<248> text;
  describe_excess(core_.schema, *excess, text);
  request(HaltCause::error, text.view());
}

void Halts::find_gap(bool fresh) noexcept {
  const std::int64_t gap = gaps_.exceeded(fresh ? 0 : core_.current, boot_now());
  if (gap == 0 || latch_.acts()) return;
  constexpr std::int64_t kMillisecond = 1'000'000;
  ShortText<160> text;
  text.add("no iteration for ").add_seconds(gap - gap % kMillisecond);
  text.add(", longer than --gap ")
      .add_seconds(gaps_.most())
      .add(": the process was stopped, the machine slept, or the driver hung");
  request(HaltCause::overruns, text.view());
}

void Halts::begin() noexcept {
  const bool driver_halted = stage_ == HaltStage::unexplained || stage_ == HaltStage::explained;
  stage_ = latch_.show(core_.current) ? HaltStage::explained : HaltStage::unexplained;
  core_.journal.halt(JournalKind::halt, latch_.halt());
  // batches with a lower ticket that are committed later were sent before the halt: they end as
  // halted when they are taken
  below_ = core_.segment.view().bell().tickets.load(std::memory_order_seq_cst);  // sync tickets
  core_.schedule.set_aside();
  core_.controller.halt(core_.current);
  core_.drop_running({Status::halted, Reason::halted});
  bursts_.stop(BurstEnd::cut);
  if (driver_halted) return;
  if (!readings_.empty()) readings_.begin_of_halt();
  if (core_.server != nullptr && !core_.asks("the handler of a halt", &RequestServer::halt)) {
    core_.fail("the robot failed in the call that begins a halt");
  }
}

void Halts::complete_reason() noexcept {
  if (!latch_.show(latch_.halt().iteration)) return;
  stage_ = HaltStage::explained;
  core_.journal.halt(JournalKind::halt_reason, latch_.halt());
}

void Halts::end_scheduled() noexcept {
  for (std::uint32_t i = 0; i < kScheduledPerIteration && core_.schedule.has_aside(); ++i) {
    const StagedBatch sent = core_.schedule.take_aside();
    if (!admitted_during_halt(sent)) continue;
    if (ends_for_silence(core_, sent)) continue;
    if (core_.schedule.has_room(sent.lane, sent.at)) {
      core_.schedule.add(sent);
    } else {
      core_.reject(sent, Reason::full);
    }
  }
}

bool Halts::admitted_during_halt(const StagedBatch& sent) noexcept {
  const bool before = sent.ticket < below_;
  if ((!before && !latch_.acts()) || !core_.controller.effort(sent.batch).moves) return true;
  core_.end_batch(sent, Reason::halted, 0, before ? Status::halted : Status::rejected);
  return false;
}

ShortText<200> Halts::refusal(std::uint64_t number) const noexcept {
  ShortText<200> why;
  const std::uint64_t acting = halt().number;
  if (number < acting) {
    why.add("halt ").add(acting).add(" came after it: read its reason, then resume halt ");
    why.add(acting);
  } else if (number > acting) {
    why.add("there is no halt ").add(number).add(": halt ").add(acting).add(" is in force");
  } else if (core_.controller.braking() || core_.schedule.has_aside()) {
    why.add(core_.schema.head.bursting == 0
                ? "the robot still brakes: resume when it has come to rest"
                : "the robot still brakes: burst until it is at rest, then resume");
  }
  return why;
}

bool Halts::clear() noexcept {
  stage_ = HaltStage::resumed;
  const bool confirmed = core_.recorded == nullptr || core_.recorded->confirms(JournalKind::resume);
  // before the halt is cleared: a driver's thread that halts again for the same reason from then on
  // requests a new halt
  for (auto& last : requested_) last.store(0, std::memory_order_seq_cst);
  if (!confirmed || !latch_.clear()) return false;
  stage_ = HaltStage::none;
  return true;
}

}  // namespace o80
