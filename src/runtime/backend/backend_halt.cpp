// How a backend halts and resumes. The loop checks the words of memory/segment/halt_word.hpp in
// each step. See src/runtime/README.md#halts.

#include <algorithm>

#include "base/short_text.hpp"
#include "runtime/backend/backend_body.hpp"
#include "runtime/journal/recorded_decisions.hpp"

namespace o80 {

namespace {
constexpr std::uint32_t kScheduledPerIteration = 256;  // scheduled batches that a halt ends

/// Hash of a text (FNV-1a); never 0.
std::uint64_t fingerprint(std::string_view text) noexcept {
  std::uint64_t print = 0xCBF29CE484222325;
  for (const char c : text) print = (print ^ static_cast<unsigned char>(c)) * 0x100000001B3;
  return print | 1;
}
}  // namespace

/// Requests a halt on behalf of this process. A driver may repeat a halt with each reading: the
/// same text again is the same halt and keeps its number for `resume`; another text is another
/// halt.
void UntypedBackend::Body::ask_to_halt(HaltCause cause, std::string_view text) noexcept {
  std::atomic<std::uint64_t>& last = own_halts_[static_cast<std::size_t>(cause)];
  const std::uint64_t print = fingerprint(text);
  if (last.exchange(print, std::memory_order_relaxed) == print) return;
  if (recorded_ != nullptr) return recorded_->ask_to_halt(cause, text);
  request_halt(segment.view(), cause, {}, text);
}

void UntypedBackend::Body::complete_reason() noexcept {
  if (!halts.show(halts.halt().iteration)) return;
  halt_stage_ = HaltStage::explained;
  journal.halt(JournalKind::halt_reason, halts.halt());
}

/// Updates Counters::acts before the desired states are written. If this backend is killed while
/// commands act, its successor starts halted.
void UntypedBackend::Body::show_acts() noexcept {
  if (schema.head.bursting != 0) return;
  const std::uint64_t* active = controller.active_mask();
  const bool moves = running.moves() || std::any_of(active, active + layout.mask_words,
                                                    [](std::uint64_t word) { return word != 0; });
  const bool stays = moves || !holder_.is_nobody() || (shown_acts_ != 0 && controller.holds());
  const std::uint32_t acts = stays ? 1 : 0;
  if (acts == shown_acts_) return;
  shown_acts_ = acts;
  segment.view().counters().acts.store(acts, std::memory_order_relaxed);
}

/// Halts if the published row exceeds an error limit.
void UntypedBackend::Body::watch_errors() noexcept {
  if (halts.acts()) return;
  const auto excess = errors_.find(controller.desired(), row() + layout.observed);
  if (!excess) return;
  ShortText<248> text;
  describe_excess(schema, *excess, text);
  ask_to_halt(HaltCause::error, text.view());
}

/// Halts if the loop stood still since the row before. A request that makes a fresh start may take
/// its time.
void UntypedBackend::Body::watch_gaps(bool fresh) noexcept {
  const std::int64_t gap = gaps_.exceeded(fresh ? 0 : current, boot_now());
  if (gap == 0 || halts.acts()) return;
  constexpr std::int64_t kMillisecond = 1'000'000;
  ShortText<160> text;
  text.add("no iteration for ").add_seconds(gap - gap % kMillisecond);
  text.add(", longer than --gap ")
      .add_seconds(gaps_.most())
      .add(": the process was stopped, the machine slept, or the driver hung");
  ask_to_halt(HaltCause::overruns, text.view());
}

void UntypedBackend::Body::purge_to_stop() noexcept {
  controller.purge(kEveryActuator, current, Reason::stopped);
  drop_running({Status::purged, Reason::stopped});
}

void UntypedBackend::Body::set_timing(const Timing& now) noexcept {
  const std::uint32_t late = now.overruns - timing.overruns;
  timing = now;
  if (late == 0 || !overruns_.exceeded(monotonic_now())) return;
  ShortText<120> text;
  text.add(overruns_.most())
      .add(" iterations within a second were late or missed their tick: --max-overruns");
  ask_to_halt(HaltCause::overruns, text.view());
}

/// Ends all commands and makes every actuator brake.
void UntypedBackend::Body::begin_halt() noexcept {
  const bool driver_halted =
      halt_stage_ == HaltStage::unexplained || halt_stage_ == HaltStage::explained;
  halt_stage_ = halts.show(current) ? HaltStage::explained : HaltStage::unexplained;
  journal.halt(JournalKind::halt, halts.halt());
  // batches with a lower ticket that are committed later were sent before the halt: they end as
  // halted when they are taken
  halted_below_ = segment.view().bell().tickets.load(std::memory_order_seq_cst);  // sync tickets
  schedule.set_aside();
  controller.halt(current);
  drop_running({Status::halted, Reason::halted});
  stop_burst(BurstEnd::cut);
  if (driver_halted) return;
  if (!readings_.empty()) begin_to_watch();
  if (server_ != nullptr && !asks("the handler of a halt", &RequestServer::halt)) {
    fail("the robot failed in the call that begins a halt");
  }
}

/// Checks the scheduled batches that a halt or the watchdog has set aside, a bounded number in each
/// iteration: ends them or schedules them again.
void UntypedBackend::Body::end_scheduled() noexcept {
  for (std::uint32_t i = 0; i < kScheduledPerIteration && schedule.has_aside(); ++i) {
    const StagedBatch sent = schedule.take_aside();
    if (!admitted_during_halt(sent)) continue;
    if (ends_for_silence(sent)) continue;
    if (schedule.has_room(sent.lane, sent.at)) {
      schedule.add(sent);
    } else {
      reject(sent, Reason::full);
    }
  }
}

/// Ends a scheduled batch whose sender has become silent since; false if it has not.
bool UntypedBackend::Body::ends_for_silence(const StagedBatch& sent) noexcept {
  if (!sent.silent) return false;
  end_batch(sent, Reason::silence, 0, Status::purged);
  return true;
}

/// True if halts permit the batch. Otherwise ends it: as halted if it was sent before the halt, as
/// rejected if it was sent while the halt is in force.
bool UntypedBackend::Body::admitted_during_halt(const StagedBatch& sent) noexcept {
  const bool before = sent.ticket < halted_below_;
  if ((!before && !halts.acts()) || !controller.effort(sent.batch).moves) return true;
  end_batch(sent, Reason::halted, 0, before ? Status::halted : Status::rejected);
  return false;
}

Outcome UntypedBackend::Body::resume(std::uint32_t lane, CommandId id, std::uint64_t number,
                                     bool accepts) noexcept {
  if (!halts.acts()) return {};
  const auto refuse = [&](std::string_view why, Reason reason = Reason::halted) {
    lanes[lane].set_message(id, why);
    return Outcome{Status::rejected, reason, 0};
  };
  ShortText<200> why;
  const std::uint64_t acting = halts.halt().number;
  if (number < acting) {
    why.add("halt ").add(acting).add(" came after it: read its reason, then resume halt ");
    why.add(acting);
    return refuse(why.view());
  }
  if (number > acting) {
    why.add("there is no halt ").add(number).add(": halt ").add(acting).add(" is in force");
    return refuse(why.view());
  }
  if (controller.braking() || schedule.has_aside()) {
    return refuse(schema.head.bursting == 0
                      ? "the robot still brakes: resume when it has come to rest"
                      : "the robot still brakes: burst until it is at rest, then resume");
  }

  ShortText<248> unread;
  if (name_not_finite(row() + layout.observed, "the last reading", unread)) {
    return refuse(unread.view(), Reason::driver);
  }
  accepts = accepts || recorded_ != nullptr;  // a replay obeys
  if (!accepts && is_misread(row() + layout.observed, kToResume, unread)) {
    return refuse(unread.view(), Reason::reading);
  }

  // the robot may refuse; a halt requested meanwhile stays
  if (server_ != nullptr) {
    Served served = asks("the handler of a resume", &RequestServer::resume);
    if (served.kind == Served::Kind::running) {
      served = Served::rejected("the robot is not ready: resume it again when it is");
    }
    if (served.kind == Served::Kind::failed) fail(served.why());
    if (served.kind == Served::Kind::failed || served.kind == Served::Kind::rejected) {
      return refuse(served.why(), Reason::driver);
    }
  }
  halt_stage_ = HaltStage::resumed;
  const bool confirmed = recorded_ == nullptr || recorded_->confirms(JournalKind::resume);
  // before the halt is cleared: a driver's thread that halts again for the same reason from then on
  // requests a new halt
  for (auto& last : own_halts_) last.store(0, std::memory_order_seq_cst);
  if (!confirmed || !halts.clear()) {
    return refuse("another halt was requested meanwhile: read its reason, then resume that one");
  }
  halt_stage_ = HaltStage::none;
  journal.resume(lane, taking_owner_, number);
  if (recorded_ != nullptr && !recorded_->begins_with_fresh_start(current)) {
    return refuse("the reading was refused in the recorded run", Reason::reading);
  }
  FreshReading reading{row() + layout.observed, row() + layout.extended,
                       reinterpret_cast<std::byte*>(fresh_desired_.data())};
  if (server_ != nullptr && !read_again(reading, accepts ? Judged::none : Judged::all, unread)) {
    ask_to_halt(HaltCause::error, unread.view());
    return refuse(unread.view(), Reason::reading);
  }
  return begin_afresh(lane, reading);
}

}  // namespace o80
