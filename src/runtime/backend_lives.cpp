// What a backend does about frontends that die or fall silent.

#include <array>
#include <iterator>

#include "base/short_text.hpp"
#include "memory/atomic_words.hpp"
#include "runtime/backend_body.hpp"

namespace o80 {

void UntypedBackend::Body::stale(std::uint32_t lane, Reason reason) noexcept {
  if (stale_ == Stale::purge) controller.purge_lane(lane, kEveryActuator, current, reason);
  const bool silent = reason == Reason::silence;
  // what a dead one scheduled is known by its lane when it is due
  if (silent) schedule.set_aside_of_silent(lane);
  const std::string_view why = silent ? "a commanding frontend showed no life for longer than is "
                                        "allowed: see silence and stale"
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

void UntypedBackend::Body::look_at_lives() noexcept {
  if (granted()) mourn(burst_lane_, lanes[burst_lane_].dead_predecessor());
  if (granted() && is_called_off()) stop_burst();
  // the bell stands where every frontend writes: whatever it says, lanes are looked at now and then
  const std::uint32_t rounds = liveness.rounds();
  if (rounds != seen_rounds_) lanes.look_again();
  seen_rounds_ = rounds;

  const std::uint32_t changes = liveness.changes();
  if (changes == seen_changes_) return;
  seen_changes_ = changes;
  for (std::uint32_t i = 0; i < lanes.size(); ++i) {
    lanes[i].meet_owner();
    lives_[i] = liveness.lane(i);
    const bool died = lives_[i].state == LaneState::died;
    mourn(i, died ? lives_[i].incarnation : lanes[i].dead_predecessor());
  }
}

/// Does what is to be done when an owner of a lane has died, once.
void UntypedBackend::Body::mourn(std::uint32_t lane, std::uint64_t incarnation) noexcept {
  if (incarnation <= mourned_[lane]) return;
  mourned_[lane] = incarnation;
  stale(lane, Reason::dead_frontend);
  if (granted() && burst_lane_ == lane && burst_incarnation_ <= incarnation) stop_burst();
  // it may have died before it rang
  lanes.look_again();
}

/// Control falls with its holder: closed, dead, or its lane in other hands.
void UntypedBackend::Body::watch_holder() noexcept {
  if (holder_ == kNobody) return;
  const LaneLife life = liveness.lane(holder_);
  const bool died = life.state == LaneState::died && life.incarnation == holder_incarnation_;
  if (died || lanes[holder_].closed() >= holder_incarnation_ ||
      lanes[holder_].incarnation() != holder_incarnation_) {
    holder_ = kNobody;
  }
}

/// The owner of a lane has sent something.
void UntypedBackend::Body::break_silence(std::uint32_t lane) noexcept {
  last_life_[lane] = current;
}

/// The watchdog: applies the policy to commanders that showed no life for too long while something
/// of theirs acts.
void UntypedBackend::Body::watch_silence() noexcept {
  if (silence_ == 0 || halts.acts()) return;
  for (std::uint32_t i = 0; i < lanes.size(); ++i) {
    if (current - last_life_[i] <= silence_) continue;
    // it may have shown life without a batch; nobody lives in the future
    last_life_[i] = std::max(last_life_[i], std::min(lanes[i].life(), current - 1));
    if (current - last_life_[i] <= silence_) continue;
    const bool bursts = granted() && burst_lane_ == i;
    const bool acts = holder_ == i || controller.acts(i) || running.moves(i);
    if (bursts || !acts) {
      last_life_[i] = current;
      continue;
    }
    stale(i, Reason::silence);
    if (holder_ == i) holder_ = kNobody;
    last_life_[i] = current;
  }
}

}  // namespace o80
