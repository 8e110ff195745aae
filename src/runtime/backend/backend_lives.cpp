// How a backend handles frontends that die or become silent.
// See src/runtime/README.md#watchdog and src/memory/README.md#lanes.

#include <unistd.h>

#include <algorithm>
#include <array>
#include <iterator>
#include <utility>

#include "base/short_text.hpp"
#include "memory/os/atomic_words.hpp"
#include "runtime/backend/backend_body.hpp"

namespace o80 {

void UntypedBackend::Body::stale(std::uint32_t lane, Reason reason) noexcept {
  if (stale_ == Stale::purge) controller.purge_lane(lane, kEveryActuator, current, reason);
  const bool silent = reason == Reason::silence;
  // scheduled batches of a dead owner are rejected when they are due (is_of_dead)
  if (silent) schedule.set_aside_of_silent(lane);
  const std::string_view why = silent
                                   ? "a commanding frontend gave no sign of life for longer than "
                                     "the watchdog (silence) allows"
                                   : "a commanding frontend died";
  if (stale_ == Stale::stop) fail(why);
  if (stale_ == Stale::halt) {
    ShortText<248> text;
    std::array<char, 64> owner{};
    load_text(segment.view().lane(lane).owner, std::size(segment.view().lane(lane).owner),
              owner.data());
    text.add(why).add(" (").add(owner.data()).add(")");
    ask_to_halt(silent ? HaltCause::silence : HaltCause::dead_frontend, text.view());
  }
}

void UntypedBackend::Body::poll_liveness() noexcept {
  const bool has_sender = burst_.runs() && !burst_.is_direct();
  if (has_sender) {
    const std::uint64_t dead = lanes[burst_.lane()].dead_predecessor();
    if (dead > handled_deaths_[burst_.lane()]) on_owner_death(burst_.lane(), dead);
    if (burst_.runs() && is_called_off()) stop_burst();
  }
  // any frontend can corrupt the bell, so all lanes are scanned after each round of the helper
  const std::uint32_t rounds = liveness.rounds();
  if (rounds != seen_rounds_) {
    lanes.rescan();
    if (schema.head.bursting == 0 && liveness.nameless() && !std::exchange(is_nameless_, true))
      halt_nameless();
  }
  seen_rounds_ = rounds;

  const std::uint32_t changes = liveness.changes();
  if (changes == seen_changes_) return;
  seen_changes_ = changes;
  for (std::uint32_t i = 0; i < lanes.size(); ++i) {
    lanes[i].poll_owner();
    lives_[i] = liveness.lane(i);
    const bool died = lives_[i].state == LaneState::died;
    on_owner_death(i, died ? lives_[i].incarnation : lanes[i].dead_predecessor());
  }
}

/// A robot that nobody can find by its name cannot be stopped by it either.
void UntypedBackend::Body::halt_nameless() noexcept {
  ShortText<248> text;
  text.add("the files of this segment were removed or replaced, so no frontend can attach. Stop ");
  text.add("process ").add(std::int64_t{getpid()}).add(": `o80 stop ").add(segment.name());
  text.add("` or `kill ").add(std::int64_t{getpid()}).add("`");
  ask_to_halt(HaltCause::unreachable, text.view());
}

/// Handles the death of a lane's owner, once for each incarnation.
void UntypedBackend::Body::on_owner_death(std::uint32_t lane, std::uint64_t incarnation) noexcept {
  if (incarnation <= handled_deaths_[lane]) return;
  handled_deaths_[lane] = incarnation;
  journal.died(lane, incarnation, stale_);
  controller.close_plan(lane, ActuatorQueue::kEveryPlan);
  stale(lane, Reason::dead_frontend);
  if (burst_.runs_for(lane) && burst_.incarnation() <= incarnation) stop_burst();
  // it may have died between its commit and the bell
  lanes.rescan();
}

/// Releases control if its holder has closed, has died, or no longer owns the lane.
void UntypedBackend::Body::watch_holder() noexcept {
  if (holder_.is_nobody()) return;
  const LaneReceiver& lane = lanes[holder_.lane()];
  const LaneLife life = liveness.lane(holder_.lane());
  const bool died = life.state == LaneState::died && life.incarnation == holder_.incarnation();
  if (died || lane.closed() >= holder_.incarnation() ||
      lane.incarnation() != holder_.incarnation()) {
    journal.control(JournalKind::control_lost, holder_.lane(), holder_.incarnation());
    holder_.release();
  }
}

/// Counts a batch as a sign of life of its sender.
void UntypedBackend::Body::note_life(std::uint32_t lane) noexcept { last_life_[lane] = current; }

/// The watchdog: applies the policy to commanders that gave no sign of life for too long while they
/// hold control or one of their commands acts.
/// Periods that the loop missed are iterations without life. They count 10 ms later, when signs of
/// life that came meanwhile have been seen.
void UntypedBackend::Body::count_missed() noexcept {
  constexpr std::int64_t kGrace = 10'000'000;  // [ns]
  if (timing.skipped != seen_skipped_) {
    if (missed_periods_ == 0) missed_at_ = current - 1;  // the row behind the gap
    missed_periods_ += timing.skipped - seen_skipped_;
    seen_skipped_ = timing.skipped;
  }
  if (missed_periods_ == 0 || (current - missed_at_) * schema.head.period < kGrace) return;
  for (Iteration& life : last_life_) {
    if (life < missed_at_) life -= missed_periods_;
  }
  counted_periods_ = std::exchange(missed_periods_, 0);
}

void UntypedBackend::Body::watch_silence() noexcept {
  if (silence_ == 0) return;
  if (halts.acts()) {
    seen_skipped_ = timing.skipped;  // nothing acts
    return;
  }
  count_missed();
  for (std::uint32_t i = 0; i < lanes.size(); ++i) {
    if (current - last_life_[i] <= silence_) continue;
    // a sign of life without a batch; clamped, because a frontend may write any number
    Iteration life = std::min(lanes[i].life(), current - 1);
    if (missed_periods_ == 0 && life < missed_at_) life -= counted_periods_;
    last_life_[i] = std::max(last_life_[i], life);
    if (current - last_life_[i] <= silence_) continue;
    const bool bursts = burst_.runs_for(i);
    const bool acts = holder_.lane() == i || controller.acts(i) || running.moves(i);
    if (bursts || !acts) {
      last_life_[i] = current;
      continue;
    }
    journal.silent(i, lanes[i].incarnation(), stale_);
    stale(i, Reason::silence);
    if (holder_.lane() == i) {
      journal.control(JournalKind::control_lost, i, holder_.incarnation());
      holder_.release();
    }
    last_life_[i] = current;
  }
}

}  // namespace o80
