#include "runtime/backend/commanders.hpp"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <iterator>
#include <utility>

#include "base/short_text.hpp"
#include "memory/os/atomic_words.hpp"

namespace o80 {

Commanders::Commanders(BackendCore& core, Bursts& bursts, Halts& halts,
                       const BackendOptions& options)
    : core_(core),
      bursts_(bursts),
      halts_(halts),
      stale_(options.stale_policy()),
      silence_(options.silence),
      lives_(core.lanes.size()),
      handled_deaths_(core.lanes.size()),
      last_life_(core.lanes.size()) {
  for (std::uint32_t i = 0; i < lives_.size(); ++i) lives_[i] = core_.liveness.lane(i);
}

void Commanders::poll_liveness() noexcept {
  const bool has_sender = bursts_.runs() && !bursts_.is_direct();
  if (has_sender) {
    const std::uint64_t dead = core_.lanes[bursts_.lane()].dead_predecessor();
    if (dead > handled_deaths_[bursts_.lane()]) on_owner_death(bursts_.lane(), dead);
    if (bursts_.runs() && bursts_.is_called_off()) bursts_.stop();
  }
  // any frontend can corrupt the bell, so all lanes are scanned after each round of the helper
  const std::uint32_t rounds = core_.liveness.rounds();
  if (rounds != seen_rounds_) {
    core_.lanes.rescan();
    if (core_.schema.head.bursting == 0 && core_.liveness.nameless() &&
        !std::exchange(is_nameless_, true))
      halt_unreachable();
  }
  seen_rounds_ = rounds;

  const std::uint32_t changes = core_.liveness.changes();
  if (changes == seen_changes_) return;
  seen_changes_ = changes;
  for (std::uint32_t i = 0; i < core_.lanes.size(); ++i) {
    core_.lanes[i].poll_owner();
    lives_[i] = core_.liveness.lane(i);
    const bool died = lives_[i].state == LaneState::died;
    on_owner_death(i, died ? lives_[i].incarnation : core_.lanes[i].dead_predecessor());
  }
}

void Commanders::on_owner_death(std::uint32_t lane, std::uint64_t incarnation) noexcept {
  if (incarnation <= handled_deaths_[lane]) return;
  handled_deaths_[lane] = incarnation;
  core_.journal.died(lane, incarnation, stale_);
  core_.controller.close_plan(lane, ActuatorQueue::kEveryPlan);
  apply_policy(lane, Reason::dead_frontend);
  if (bursts_.runs_for(lane) && bursts_.incarnation() <= incarnation) bursts_.stop();
  // it may have died between its commit and the bell
  core_.lanes.rescan();
}

bool Commanders::is_of_dead(const StagedBatch& sent) const noexcept {
  const LaneLife& life = lives_[sent.lane];
  return sent.of_dead ||
         (sent.incarnation != 0 && sent.incarnation <= handled_deaths_[sent.lane]) ||
         (life.state == LaneState::died &&
          life.incarnation == core_.lanes[sent.lane].incarnation());
}

void Commanders::apply_policy(std::uint32_t lane, Reason reason) noexcept {
  if (stale_ == Stale::purge)
    core_.controller.purge_lane(lane, kEveryActuator, core_.current, reason);
  const bool silent = reason == Reason::silence;
  // scheduled batches of a dead owner are rejected when they are due (is_of_dead)
  if (silent) core_.schedule.set_aside_of_silent(lane);
  const std::string_view why = silent
                                   ? "a commanding frontend gave no sign of life for longer than "
                                     "the watchdog (silence) allows"
                                   : "a commanding frontend died";
  if (stale_ == Stale::stop) core_.fail(why);
  if (stale_ == Stale::halt) {
    ShortText<248> text;
    std::array<char, 64> owner{};
    load_text(core_.segment.view().lane(lane).owner,
              std::size(core_.segment.view().lane(lane).owner), owner.data());
    text.add(why).add(" (").add(owner.data()).add(")");
    halts_.request(silent ? HaltCause::silence : HaltCause::dead_frontend, text.view());
  }
}

/// A robot that nobody can find by its name cannot be stopped by it either.
void Commanders::halt_unreachable() noexcept {
  ShortText<248> text;
  text.add("the files of this segment were removed or replaced, so no frontend can attach. Stop ");
  text.add("process ").add(std::int64_t{getpid()}).add(": `o80 stop ").add(core_.segment.name());
  text.add("` or `kill ").add(std::int64_t{getpid()}).add("`");
  halts_.request(HaltCause::unreachable, text.view());
}

void Commanders::find_silent() noexcept {
  if (halts_.acts()) {
    seen_skipped_ = core_.timing.skipped;  // nothing acts
    return;
  }
  count_missed();
  for (std::uint32_t i = 0; i < core_.lanes.size(); ++i) {
    if (core_.current - last_life_[i] <= silence_) continue;
    // a sign of life without a batch; clamped, because a frontend may write any number
    Iteration life = std::min(core_.lanes[i].life(), core_.current - 1);
    if (missed_periods_ == 0 && life < missed_at_) life -= counted_periods_;
    last_life_[i] = std::max(last_life_[i], life);
    if (core_.current - last_life_[i] <= silence_) continue;
    const bool bursts = bursts_.runs_for(i);
    const bool acts = holder_.lane() == i || core_.controller.acts(i) || core_.running.moves(i);
    if (bursts || !acts) {
      last_life_[i] = core_.current;
      continue;
    }
    core_.journal.silent(i, core_.lanes[i].incarnation(), stale_);
    apply_policy(i, Reason::silence);
    if (holder_.lane() == i) {
      core_.journal.control(JournalKind::control_lost, i, holder_.incarnation());
      holder_.release();
    }
    last_life_[i] = core_.current;
  }
}

/// Periods that the loop missed are iterations without life. They count 10 ms later, when signs of
/// life that came meanwhile have been seen.
void Commanders::count_missed() noexcept {
  constexpr std::int64_t kGrace = 10'000'000;  // [ns]
  if (core_.timing.skipped != seen_skipped_) {
    if (missed_periods_ == 0) missed_at_ = core_.current - 1;  // the row behind the gap
    missed_periods_ += core_.timing.skipped - seen_skipped_;
    seen_skipped_ = core_.timing.skipped;
  }
  if (missed_periods_ == 0 || (core_.current - missed_at_) * core_.schema.head.period < kGrace)
    return;
  for (Iteration& life : last_life_) {
    if (life < missed_at_) life -= missed_periods_;
  }
  counted_periods_ = std::exchange(missed_periods_, 0);
}

void Commanders::find_lost_holder() noexcept {
  const LaneReceiver& lane = core_.lanes[holder_.lane()];
  const LaneLife life = core_.liveness.lane(holder_.lane());
  const bool died = life.state == LaneState::died && life.incarnation == holder_.incarnation();
  if (died || lane.closed() >= holder_.incarnation() ||
      lane.incarnation() != holder_.incarnation()) {
    core_.journal.control(JournalKind::control_lost, holder_.lane(), holder_.incarnation());
    holder_.release();
  }
}

void Commanders::take_control(std::uint32_t lane, std::uint64_t owner) noexcept {
  // Batches of other lanes are rejected while a lane has control, so they do not get here. A sender
  // that has closed or lost its lane does not get control.
  if (owner == 0 || owner != core_.lanes[lane].incarnation()) return;
  holder_.take(lane, owner);
  core_.journal.control(JournalKind::control_taken, lane, owner);
}

void Commanders::release_control(std::uint32_t lane, std::uint64_t owner) noexcept {
  if (!holder_.is(lane, owner)) return;
  holder_.release();
  core_.journal.control(JournalKind::control_released, lane, owner);
}

}  // namespace o80
