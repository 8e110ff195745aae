#include "control/motion/number_motion.hpp"

#include <algorithm>

namespace o80 {

std::int64_t NumberMotion::plan_for(const Requested& requested) noexcept {
  PlanTask task{requested, requested.start ? Moment{*requested.start} : guard_.moment(),
                guard_.stopping_span(), guard_.rates(), requested.start || guard_.stays()};
  if (accelerates() && !requested.start) task.stop = guard_.stop();
  task.span.include(requested.target);
  task.span.include(task.from.position);
  guard_.begin(task.span);
  if (!accelerates()) task.span.include(former_target_);

  planned_ = true;
  // without limits it jumps to where it starts, which is no speed
  const double from = task.from.position;
  jumps_ = requested.start && !has_rates() && guard_.admits(from);
  const bool starts_elsewhere =
      requested.start && !jumps_ && (from != guard_.position() || !guard_.at_rest());
  follows_ = leaves_ || starts_elsewhere || !guard_.admits(guard_.position());
  return plan_.propose(task);
}

void NumberMotion::settle(std::int64_t iterations) noexcept {
  if (std::exchange(jumps_at_once_, false)) {
    if (iterations == 1) {
      planned_ = true;
      follows_ = !guard_.admits(guard_.position());
      return plan_.line(requested_.target, requested_.target);
    }
    plan_for(requested_);
  }
  if (jumps_) guard_.restart(plan_.task().from.position);
  plan_.settle(iterations);
}

/// One iteration by `move`, as far as bounds of the integral allow; returns the one that stops it.
template <class Move>
Limit NumberMotion::move(Move&& move) noexcept {
  const double before = guard_.position();
  if (integral_) integral_->note(guard_);
  move();
  is_blocked_ = false;
  const Limit bound = integral_ ? hold_back() : Limit::none;
  former_difference_ = std::exchange(difference_, guard_.position() - before);
  return bound;
}

Limit NumberMotion::hold_back() noexcept {
  const auto [bound, velocity] = integral_->admit(guard_.position());
  if (bound == Limit::none) return bound;
  guard_ = integral_->noted();
  guard_.follow_within_bounds();
  if (!guard_.pass(velocity)) guard_.follow(velocity);
  follows_ = planned_;
  held_back_ = true;
  is_blocked_ = integral_->is_blocked();
  return bound;
}

Limit NumberMotion::step(double low, double high) noexcept {
  Limit limit = Limit::none;
  const Limit bound = move([&] {
    const double wanted = std::clamp(plan_.next(), low, high);
    if (!follows_ && guard_.pass(wanted)) return;
    follows_ = true;
    limit = follow(wanted);
  });
  return bound != Limit::none ? bound : limit;
}

/// One iteration of what is not planned. Apart, so that what is planned pays nothing for it.
[[gnu::noinline]] Limit NumberMotion::follow(double wanted) noexcept {
  if (leave()) return Limit::acceleration;
  const Limit limit = guard_.follow(wanted);
  // a bound may hold the curve of rows
  if (limit != Limit::none || !has_bounds_ || !plan_.is_held()) return limit;
  return wanted >= guard_.maximum() ? Limit::maximum : Limit::minimum;
}

bool NumberMotion::brake() noexcept {
  bool moves = is_away();
  const Limit bound = move([&] {
    const double before = guard_.position();
    if (moves) {
      guard_.widen(*rest_);
      guard_.follow(*rest_);
      // a jump is no speed
      if (!accelerates() && guard_.position() == *rest_) guard_.rest();
    } else if (!leave()) {
      guard_.brake();
    }
    moves = moves || guard_.position() != before || !stays();
  });
  // a number at rest at a bound is no longer held away from its resting value
  if (is_blocked_) held_ = false;
  return moves || bound != Limit::none;
}

}  // namespace o80
