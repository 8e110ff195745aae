// What a backend does about frontends that die or fall silent.

#include "backend_body.hpp"

namespace o80 {

void UntypedBackend::Body::stale(std::uint32_t lane, Reason reason) noexcept {
  if (stale_ == Stale::purge) controller.purge_lane(lane, kEveryActuator, current, reason);
  if (stale_ == Stale::stop) {
    fail(reason == Reason::silence ? "no frontend sent anything for longer than is allowed"
                                   : "a commanding frontend died");
  }
}

void UntypedBackend::Body::look_at_lives() noexcept {
  if (granted()) mourn(burst_lane_, lanes[burst_lane_].dead_predecessor());
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
  // nobody waits for the end of its burst
  if (granted() && burst_lane_ == lane && burst_incarnation_ <= incarnation) burst_left_ = 1;
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

void UntypedBackend::Body::watch_silence() noexcept {
  if (silence_ == 0 || current - last_batch_ <= silence_ || !controller.active()) return;
  if (stale_ == Stale::hold) return;
  for (std::uint32_t i = 0; i < lanes.size(); ++i) stale(i, Reason::silence);
}

}  // namespace o80
