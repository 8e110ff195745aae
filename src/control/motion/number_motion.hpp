#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <utility>

#include "control/motion/integral_bound.hpp"
#include "control/motion/number_limiter.hpp"
#include "control/motion/number_plan.hpp"
#include "control/motion/state_layout.hpp"

namespace o80 {

/// The motion of one number of a state: a plan, and the guard of its limits behind it.
///
/// Realtime: yes.
class NumberMotion {
 public:
  /// `rest`: its value without a command, if any. `integral`: bounds of what it moves, if any.
  /// `has_bounds`: false if its minimum and maximum are but the range of its kind.
  NumberMotion(const NumberLimiter& guard, std::optional<double> rest,
               std::unique_ptr<IntegralBound> integral = nullptr, bool has_bounds = true) noexcept
      : guard_(guard), rest_(rest), has_bounds_(has_bounds), integral_(std::move(integral)) {}

  /// Where what it moves is: before each step() or brake().
  void observe(const StateLayout& layout, const std::byte* observed) noexcept {
    if (integral_) integral_->observe(layout.number(integral_->number(), observed));
  }
  /// True if these bounds have changed its motion since begin().
  bool was_held_back() const noexcept { return held_back_; }
  /// True if they keep it at rest in this iteration.
  bool is_blocked() const noexcept { return is_blocked_; }
  /// First (order 1) or second difference of its positions, to the iteration before.
  double difference(std::uint32_t order) const noexcept {
    return order == 1 ? difference_ : difference_ - former_difference_;
  }

  const NumberLimiter& guard() const noexcept { return guard_; }
  double position() const noexcept { return guard_.position(); }
  const NumberPlan& plan() const noexcept { return plan_; }
  /// True while a command moves it on a straight line.
  bool is_on_line() const noexcept { return planned_ && plan_.is_line(); }
  /// True if it has a limit of speed or acceleration: rows are followed, not shown.
  bool has_rates() const noexcept {
    return std::isfinite(guard_.rates().speed) || std::isfinite(guard_.rates().acceleration);
  }
  bool accelerates() const noexcept { return std::isfinite(guard_.rates().acceleration); }

  /// Sets the position, at rest.
  void restart(double position) noexcept {
    guard_.restart(position);
    planned_ = follows_ = of_rows_ = held_ = leaves_ = held_back_ = is_blocked_ = false;
    difference_ = former_difference_ = 0.0;
  }
  /// One iteration of a motion that was made elsewhere.
  void trace(double position) noexcept { guard_.accept(position); }
  /// A command begins: notes from which motion.
  void begin() noexcept {
    former_target_ = planned_ ? plan_.target() : guard_.position();
    held_back_ = false;
    end();
  }

  /// Proposes a number of iterations for a plan to rest at the target.
  std::int64_t propose(const Requested& requested) noexcept {
    // mostly nothing limits a set-point: it needs no plan
    jumps_at_once_ = !has_rates() && requested.iterations <= 1 && !requested.start &&
                     !std::isfinite(requested.cruise);
    if (!jumps_at_once_) return plan_for(requested);
    requested_ = requested;
    return 1;
  }
  /// Then plans it for `iterations`, at least those.
  void settle(std::int64_t iterations) noexcept;
  /// Rows begin: from the plan of the rows before them, whatever limits made of that; else from the
  /// motion of this number.
  void take_over() noexcept {
    const bool continues = planned_ && of_rows_;
    const Moment from = moment();
    begin();
    start_from(from, continues);
  }
  /// Where they would begin.
  Moment moment() const noexcept {
    if (planned_ && of_rows_) return plan_.moment();
    return rests_ ? Moment{guard_.position()} : guard_.moment();
  }
  /// Or they begin here.
  void start_from(const Moment& from, bool continues) noexcept {
    plan_.start_from(from);
    Span span = guard_.stopping_span();
    span.include(from.position);
    continues ? guard_.reach(span) : guard_.begin(span);
    planned_ = follows_ = of_rows_ = true;
  }
  /// Or at an observed position: without limits the number jumps there, which is no speed.
  void start_at(double position) noexcept {
    if (!has_rates() && guard_.admits(position)) guard_.restart(position);
    start_from({position}, false);
  }
  bool is_planned() const noexcept { return planned_; }
  /// Then the plan to the next row, as NumberPlan has it.
  void line_on(double target, std::int64_t iterations) noexcept {
    plan_.line_on(target, iterations);
    guard_.widen(target);
  }
  void curve_on(Profile profile, double target, std::int64_t iterations,
                const RowsAhead& ahead) noexcept {
    Span reach =
        plan_.curve_on(profile, target, iterations, ahead, {guard_.minimum(), guard_.maximum()});
    // the shortest stop from a place before a turning point ends behind it
    const Rates& rates = guard_.rates();
    const double turn =
        std::min(ahead.iterations > 0 ? plan_.turn(rates.jerk) : 0.0, rates.acceleration);
    const double ramp = turn / rates.jerk;
    const double room = turn > 0.0 ? turn * (1.0 + ramp * ramp / 24.0) : 0.0;
    if (turn > 0.0) reach.include(plan_.crest());
    widen(reach.low - room);
    widen(reach.high + room);
  }
  /// To the row in the first of its iterations.
  void jump_on(double target) noexcept {
    plan_.hold_on(target);
    guard_.widen(target);
  }
  /// Goes to the target within the limits, whatever they keep it from (Profile::as_sent).
  void follow_as_sent(double target) noexcept {
    if (!planned_) guard_.begin();
    planned_ = follows_ = true;
    plan_.line(target, target);
  }
  /// The span of what is followed reaches to here.
  void widen(double position) noexcept {
    if (follows_) guard_.widen(position);
  }

  /// One iteration of the plan, in the range of its kind; returns the limit that changed it.
  Limit step(double low, double high) noexcept;
  /// True if nothing of the plan, which is over, is left to follow.
  bool arrived() const noexcept {
    return !follows_ || (!leaves_ && guard_.position() == plan_.target());
  }
  bool follows() const noexcept { return follows_; }
  /// How far it is from its plan.
  double off_plan() const noexcept { return std::abs(plan_.place() - guard_.position()); }
  /// The plan ends, at its target if that is `arrived`: what follows is another command, or none.
  /// If the shortest stop would leave the bounds, the plan continues until it stays inside.
  void end(bool arrived = false) noexcept {
    if (planned_ && !follows_ && !guard_.stops_inside()) {
      former_ = plan_;
      leaves_ = true;
    }
    rests_ = arrived && of_rows_;
    planned_ = follows_ = of_rows_ = false;
    guard_.follow_within_bounds();
    // a jump is no speed
    if (arrived && !accelerates()) guard_.rest();
  }
  /// One iteration without a command: to rest, as fast as the limits allow. True while it moves.
  bool brake() noexcept;

  bool has_rest() const noexcept { return rest_.has_value(); }
  /// Stays where it is, away from its rest value, until hold(false).
  void hold(bool holds) noexcept { held_ = holds && rest_.has_value(); }
  bool is_held_away() const noexcept { return held_ && guard_.position() != *rest_; }
  /// True if braking would change nothing.
  bool at_rest() const noexcept {
    const bool moves_integral = integral_ && guard_.position() != 0.0;
    return guard_.at_rest() && !is_away() && !moves_integral;
  }
  /// True if braking would not move it.
  bool stays() const noexcept { return guard_.stays() && !is_away() && !leaves_; }
  /// True if it rests, or has no limit of acceleration and can rest at once.
  bool rests() const noexcept { return stays() && (guard_.at_rest() || !accelerates()); }

 private:
  bool is_away() const noexcept { return rest_ && !held_ && guard_.position() != *rest_; }
  /// Runs an iteration of the former plan as long as a stop would leave the bounds. Then widens the
  /// span by the shortest stop from here, which may lie outside the span of the motion's start.
  bool leave() noexcept {
    if (!leaves_) return false;
    leaves_ = !guard_.stops_inside();
    if (leaves_) return guard_.pass(former_.next());
    const Span stop = guard_.stopping_span();
    guard_.widen(stop.low);
    guard_.widen(stop.high);
    return false;
  }
  template <class Move>
  Limit move(Move&& move) noexcept;
  Limit hold_back() noexcept;
  Limit follow(double wanted) noexcept;
  std::int64_t plan_for(const Requested& requested) noexcept;

  NumberLimiter guard_;
  std::optional<double> rest_;
  bool has_bounds_;
  NumberPlan plan_;
  bool planned_ = false;  // a command moves it by `plan_`
  bool follows_ = false;  // `plan_` may break limits
  bool of_rows_ = false;  // `plan_` is that of rows
  bool rests_ = false;    // such a plan has just ended: at its last row it rests
  bool held_ = false;
  bool jumps_at_once_ = false;  // propose() needed no plan
  Requested requested_;         // then
  bool jumps_ = false;          // the plan begins at its start
  // continues with the former plan, until a stop would stay inside the bounds
  bool leaves_ = false;
  NumberPlan former_;
  double former_target_ = 0.0;
  double difference_ = 0.0;  // of the positions of the last two iterations, and of those before
  double former_difference_ = 0.0;
  std::unique_ptr<IntegralBound> integral_;
  bool held_back_ = false;
  bool is_blocked_ = false;
};

}  // namespace o80
