#pragma once

#include <cstdint>

#include "control/velocity_change.hpp"

namespace o80 {

/// The time-optimal motion of one number from the motion under way to rest at a target.
///
/// It changes its speed to a cruising speed, cruises, and slows down to rest at the target, in
/// whole iterations. Where even the way to rest overshoots the target, it comes back. Compare
/// Kroeger, "On-Line Trajectory Generation in Robotic Systems" (2010), type III.
///
/// Realtime: yes, bounded time.
class FastestMotion {
 public:
  FastestMotion() = default;
  /// Speed and acceleration limits must be finite; `speed` and `acceleration` are the present ones.
  FastestMotion(double position, double speed, double acceleration, double target,
                const Rates& rates) noexcept;

  /// Until it rests at the target, at least 1.
  std::int64_t iterations() const noexcept { return iterations_; }
  /// Takes so many iterations instead, if it can: not if they are fewer, nor if the way to rest is
  /// all there is.
  void stretch(std::int64_t iterations) noexcept;
  /// The position of the next iteration; the target, bit for bit, at the last and after.
  double next() noexcept;

 private:
  /// A way to rest that first lets go of the brake for some iterations.
  struct Stop {
    double start = 0.0;      // acceleration before it
    double jerk = 0.0;       // while it lets go
    std::int64_t eased = 0;  // iterations of that
    double distance = 0.0;
    VelocityChange rest;
    double acceleration(std::int64_t i) const noexcept {
      return i <= eased ? start + static_cast<double>(i) * jerk : rest.acceleration(i - eased);
    }
    std::int64_t steps() const noexcept { return eased + rest.steps(); }
  };

  Stop stop_after(std::int64_t eased) const noexcept;
  void mix(double lowest) noexcept;
  /// Distance with so many iterations before it slows down from `cruise`.
  double distance(double cruise, double before) const noexcept;
  std::int64_t steps_to(double cruise) const noexcept;
  double time_to(double cruise) const noexcept;
  double cruise_for(double before, double low, double high) const noexcept;
  void settle() noexcept;

  // mirrored such that the target lies beyond the way to rest
  double sign_ = 1.0;
  double start_speed_ = 0.0;
  double start_acceleration_ = 0.0;
  double distance_ = 0.0;
  Rates rates_{};

  double target_ = 0.0;
  // as it goes on: sums over many iterations, whose rounding must not be seen at the end
  long double position_ = 0.0;
  long double speed_ = 0.0;  // mirrored
  std::int64_t done_ = 0;
  double cruise_ = 0.0;
  std::int64_t before_ = 0;  // iterations before it slows down
  std::int64_t iterations_ = 1;
  VelocityChange to_cruise_;
  VelocityChange to_rest_;
  // where the target lies little beyond the way to rest: the mean of two ways
  bool mixed_ = false;
  Stop nearer_;
  Stop farther_;  // unless that is the way over the cruising speed
  bool cruises_ = true;
  double share_ = 0.0;  // of the nearer one
};

}  // namespace o80
