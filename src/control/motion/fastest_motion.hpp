#pragma once

#include <algorithm>
#include <cstdint>

#include "control/motion/velocity_change.hpp"

namespace o80 {

/// The time-optimal motion of one number from its present motion to rest at a target.
///
/// It changes its speed to a cruising speed, cruises, and slows down to rest at the target, in
/// whole iterations. If even the shortest stop overshoots the target, it returns to it. See
/// Kroeger, "On-Line Trajectory Generation in Robotic Systems" (2010), type III.
///
/// Realtime: yes, bounded time.
class FastestMotion {
 public:
  /// `start` is the present motion, `stop` its shortest stop. The limits of speed and acceleration
  /// must be finite.
  FastestMotion(const Moment& start, double target, const Rates& rates,
                const VelocityChange& stop) noexcept;
  FastestMotion(const Moment& start, double target, const Rates& rates) noexcept
      : FastestMotion(start, target, rates, {-start.speed, start.acceleration, rates}) {}

  /// Number of iterations until it rests at the target, at least 1.
  std::int64_t iterations() const noexcept { return iterations_; }
  /// Stretches the motion to `iterations`, unless that is shorter or the motion is only a stop.
  void stretch(std::int64_t iterations) noexcept;
  /// The position in the next iteration; from the last iteration on the exact target.
  double next() noexcept;

 private:
  /// A stop that first reduces the deceleration for `eased` iterations.
  struct Stop {
    double start = 0.0;  // acceleration before the stop
    double jerk = 0.0;   // jerk in the first `eased` iterations
    std::int64_t eased = 0;
    double distance = 0.0;
    VelocityChange rest;
    double acceleration(std::int64_t i) const noexcept {
      return i <= eased ? start + static_cast<double>(i) * jerk : rest.acceleration(i - eased);
    }
    std::int64_t steps() const noexcept { return eased + rest.steps(); }
  };

  Stop stop_after(std::int64_t eased) const noexcept;
  void mix(double excess) noexcept;
  /// Distance of the motion that slows down from the cruise after so many iterations.
  double distance(double before) const noexcept {
    return to_cruise_.displacement() + before * cruise_ + to_rest_.displacement();
  }
  double guess(double iterations, double highest) const noexcept;
  void plan(double lowest) noexcept;
  /// Iterations before the motion slows down, and their derivative with respect to the cruise.
  struct Before {
    double value;
    double slope = 0.0;
  };
  template <class Time>
  double reach(double low, double high, Time&& before) noexcept;
  void cruise_at(double speed) noexcept {
    cruise_ = speed;
    to_cruise_ = VelocityChange(speed - start_speed_, start_acceleration_, rates_);
    to_rest_ = VelocityChange(-speed, 0.0, rates_);
  }
  /// Changes the cruising speed, if both changes of speed stay means of the same trapezoids. If
  /// not, they are to be planned anew.
  bool extend(double change) noexcept {
    cruise_ += change;
    return to_cruise_.extend(change) && to_rest_.extend(-change);
  }
  void count() noexcept {
    speed_ = start_speed_;
    const std::int64_t cruising = cruises_ ? before_ + to_rest_.steps() : farther_.steps();
    iterations_ = std::max({std::int64_t{1}, cruising, nearer_.steps()});
  }

  // mirrored by sign_, so that the target lies beyond the shortest stop
  double sign_ = 1.0;
  double start_speed_ = 0.0;
  double start_acceleration_ = 0.0;
  double distance_ = 0.0;
  Rates rates_{};

  double target_ = 0.0;
  // the present state; long double, because sums over many iterations must not show their rounding
  long double position_ = 0.0;
  long double speed_ = 0.0;  // mirrored by sign_
  std::int64_t done_ = 0;
  double cruise_ = 0.0;
  std::int64_t before_ = 0;  // iterations before the motion slows down
  std::int64_t iterations_ = 1;
  VelocityChange to_cruise_;
  VelocityChange to_rest_;
  // if the target lies a little beyond the shortest stop: the mean of two motions
  bool mixed_ = false;
  Stop nearer_;
  Stop farther_;         // unused if `cruises_`
  bool cruises_ = true;  // the farther one is the motion at the cruising speed
  double share_ = 0.0;   // weight of the nearer one
};

}  // namespace o80
