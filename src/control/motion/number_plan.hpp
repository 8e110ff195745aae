#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>

#include "control/motion/fastest_motion.hpp"
#include "control/motion/smooth_motion.hpp"
#include "o80/control/command.hpp"

namespace o80 {

/// Version of the rules that make desired states of commands. It grows when the same commands give
/// other desired states; recordings say under which rules they were made.
///
/// 1: a profile that the limiter follows.
/// 2: each command is planned to rest at its target within the limits; set-points. Faults that were
///    mended since, of about one motion in a million, have not raised it.
/// 3: starts without a search: one motion in ten thousand is shorter by some iterations, one in two
///    hundred takes another way.
inline constexpr std::int64_t kMotionRules = 3;

/// The limit that kept a number from its wanted position, or that makes a motion long.
enum class Limit : std::uint8_t {
  none,
  minimum,
  maximum,
  speed,
  acceleration,
  jerk,
  below_integral,  // the minimum and the maximum of what the number moves
  above_integral
};

/// The longest plan [iterations]. A command that needs more is rejected.
inline constexpr std::int64_t kLongestPlan = std::int64_t{1} << 31;

/// The iterations of a distance at a speed [1/iteration], at least 1. Rounding adds none.
std::int64_t iterations_of(double distance, double speed) noexcept;

/// Iterations in which a motion from here leads to a row, which is due in `iterations`, within
/// these limits: about the fewest.
double iterations_to_take_over(const Moment& from, double row, double iterations,
                               const Rates& rates) noexcept;

/// How a command asks for the target of one number.
struct Requested {
  double target = 0.0;
  double line_start = 0.0;      // where a straight line begins
  std::optional<double> start;  // a place to start from at rest, instead of its own
  std::int64_t iterations = 0;  // 0: as few as the limits allow
  double cruise = std::numeric_limits<double>::infinity();  // speed asked for [1/iteration]
  Profile profile = Profile::linear;
};

/// What comes after the row that a curve leads to.
struct RowsAhead {
  double next = 0.0;            // the next row,
  std::int64_t iterations = 0;  // so many iterations after it; 0: there is none
  // the row is the first one of a take-over. `after`: the row after the next one, if there is one
  bool is_first = false;
  double after = 0.0;
};

/// What a plan is for: one number, from its present motion to rest at a target.
struct PlanTask : Requested {
  Moment from;
  // where a smooth motion stays: position, target, and shortest stop (without a limit of
  // acceleration: former target)
  Span span;
  Rates rates{};
  bool stays = true;         // it may stop at once
  VelocityChange stop = {};  // the shortest one, with a limit of acceleration
};

/// The way of one number to its target: a position for each iteration, within its limits of speed,
/// acceleration and jerk, and at rest at the target in the last one (docs/commands.md).
///
/// Realtime: yes, bounded time.
class NumberPlan {
 public:
  /// Returns the number of iterations that it takes: those asked for, or the fewest that the limits
  /// allow. More than kLongestPlan: it cannot be planned.
  std::int64_t propose(const PlanTask& task) noexcept;
  /// Plans the motion for `iterations`, at least those of propose().
  void settle(std::int64_t iterations) noexcept;
  /// A straight line that no limit changes; line_for() sets its length.
  void line(double start, double target) noexcept {
    task_.line_start = start;
    task_.target = target;
    shape_ = Shape::line;
    line_for(1);
  }
  void line_for(std::int64_t iterations) noexcept {
    iterations_ = iterations;
    done_ = 0;
  }

  /// Rows of a chunk: the plan is here, with these derivatives.
  void start_from(const Moment& from) noexcept {
    line(from.position, from.position);
    done_ = iterations_;
    to_ = from;
  }
  /// Then to the next row at once,
  void hold_on(double target) noexcept {
    line(target, target);
    to_ = {target};
  }
  /// on a straight line,
  void line_on(double target, std::int64_t iterations) noexcept {
    line(moment().position, target);
    line_for(iterations);
    to_ = {target, target / static_cast<double>(iterations) -
                       task_.line_start / static_cast<double>(iterations)};
  }
  /// or on a curve (Profile::smooth or monotone, docs/chunks.md); at the last row it rests. Places
  /// of a smooth one outside the bounds are set to them. Returns the places between which the way
  /// to the row stays, and the begin of the way to the next one.
  Span curve_on(Profile profile, double target, std::int64_t iterations, const RowsAhead& ahead,
                const Span& bounds) noexcept;
  /// The curvature where the way to a row turns around, or will sooner than this jerk could end it:
  /// the larger one at its ends. 0: it does not.
  double turn(double jerk) const noexcept {
    if (shape_ != Shape::curve) return 0.0;
    const double fade = to_.acceleration * to_.acceleration / jerk;
    const bool will = slows() && std::abs(to_.speed) <= fade;
    if (from_.speed * to_.speed > 0.0 && !will) return 0.0;
    return std::max(std::abs(from_.acceleration), std::abs(to_.acceleration));
  }
  /// Where it would turn around behind the row; else the row.
  double crest() const noexcept {
    const double way = to_.speed * std::abs(to_.speed) / (2.0 * std::abs(to_.acceleration));
    return to_.position + (slows() ? way : 0.0);
  }
  /// Place and derivatives of the curve in the last iteration.
  Moment moment() const noexcept;
  double place() const noexcept { return done_ >= iterations_ ? task_.target : at(done_); }
  /// True if a bound holds the curve in the last iteration.
  bool is_held() const noexcept;

  /// The position in the next iteration; from the last one on the exact target.
  double next() noexcept;
  const PlanTask& task() const noexcept { return task_; }
  double target() const noexcept { return task_.target; }
  /// For a straight line: the share of the way that is done.
  double share() const noexcept {
    return static_cast<double>(done_) / static_cast<double>(iterations_);
  }
  bool is_line() const noexcept { return shape_ == Shape::line; }
  /// The limit that makes the motion long.
  Limit slowest() const noexcept {
    const double distance = std::abs(task_.target - task_.from.position);
    const double by_speed = distance / task_.rates.speed;
    const double by_acceleration = 2.0 * std::sqrt(distance / task_.rates.acceleration);
    const double by_jerk = std::cbrt(32.0 * distance / task_.rates.jerk);
    if (by_jerk > std::max(by_speed, by_acceleration)) return Limit::jerk;
    return by_acceleration > by_speed ? Limit::acceleration : Limit::speed;
  }

 private:
  enum class Shape : std::uint8_t { line, smooth, stop_first, fastest, monotone, curve };

  bool slows() const noexcept { return to_.speed * to_.acceleration < 0.0; }
  Span monotone_on(const RowsAhead& ahead) noexcept;
  Span smooth_on(const RowsAhead& ahead, const Span& bounds) noexcept;
  double curve_at(double share) const noexcept;
  double on_rows(double share) const noexcept;
  double at(std::int64_t done) const noexcept;
  std::int64_t fewest() noexcept;
  std::int64_t fewest_smooth(std::int64_t least) noexcept;
  bool smooth_from_rest() noexcept;
  bool smooth(std::int64_t iterations) noexcept {
    if (iterations == smooth_for_) return is_smooth_;
    return is_smooth_ = plan_smooth(iterations);
  }
  bool plan_smooth(std::int64_t iterations) noexcept;
  bool fits(const SmoothMotion& motion, double speed) const noexcept;
  bool stop_then_smooth(std::int64_t iterations) noexcept;

  PlanTask task_;
  Shape shape_ = Shape::line;
  std::int64_t iterations_ = 1;
  std::int64_t done_ = 0;
  std::int64_t stop_ = 0;        // iterations of `to_stop_`
  std::int64_t smooth_for_ = 0;  // iterations of `smooth_`; 0: none was tried
  bool is_smooth_ = false;       // these keep all limits
  SmoothMotion to_stop_;
  SmoothMotion smooth_;
  std::optional<FastestMotion> fastest_;
  // of a row of a chunk: place and derivatives before and at it
  Moment from_;
  Moment to_;
  Span hull_;         // the way to the row stays inside
  bool cut_ = false;  // because of bounds
  // of a curve: its derivatives at the begin and those of higher order, by the share of the way
  std::array<double, 5> order_{};
};

}  // namespace o80
