#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "control/interpolation.hpp"
#include "control/record.hpp"
#include "control/state_layout.hpp"

namespace o80 {

/// Interpolates the state of one actuator from one state to the next.
///
/// Realtime: everything but construction.
class Motion {
 public:
  explicit Motion(const StateLayout& layout);

  /// Start and target. Fill both before begin().
  std::byte* from() noexcept { return reinterpret_cast<std::byte*>(ends_.data()); }
  std::byte* to() noexcept { return from() + stride_; }

  /// Sets the exact start of one number, which `from` holds rounded to its kind. Call it before
  /// begin().
  void start_at(std::size_t number, double value) noexcept { exact_[number] = value; }
  /// Discards exact starts: all numbers start at `from`.
  void start_at_from() noexcept;
  /// Distance of one number from start to target.
  double distance(std::size_t number) const noexcept;
  /// Begins at iteration `first` for `iterations`. A minimum-jerk motion continues the motion
  /// stored by keep_moving().
  void begin(Iteration first, std::int64_t iterations, Profile profile, Pace pace) noexcept;
  /// Writes the state at an iteration; from the last iteration on the exact target.
  void state(Iteration iteration, std::byte* out) noexcept;
  /// One number of the last state(), not rounded to its kind.
  double number(std::size_t number) const noexcept;
  Iteration last() const noexcept { return last_; }
  /// True if the last state() was the target.
  bool arrived() const noexcept { return now_ >= last_; }

  /// Stores velocity and acceleration at the last state(), for the command that overwrites this
  /// one. `rows`: further waypoints of the overwritten trajectory; `ahead`: the last of them, or
  /// its target.
  void keep_moving(const std::byte* ahead, std::int64_t rows) noexcept;
  /// The same for one number of `state` that has left its motion because of a limit: its velocity
  /// and acceleration, and the position at which it would stop after `iterations`.
  void keep_moving(const std::byte* state, std::size_t number, const Moment& moment, double stop,
                   std::int64_t iterations) noexcept;
  /// Step of one number in the last iteration before keep_moving().
  double kept_step(std::size_t number) const noexcept { return moving_ ? kept_[number].step : 0.0; }
  /// Discards the stored motion of the numbers whose bits are not set.
  void leave_out(const std::uint64_t* mask) noexcept;
  /// Discards the stored motion: the next one starts at rest.
  void rest() noexcept { moving_ = false; }

  /// Iterations of a minimum-jerk motion of `number` that continues its stored motion and is never
  /// faster than `speed` [1/iteration], or than the stored motion if that is faster.
  std::int64_t iterations_at(std::size_t number, double speed) noexcept;

 private:
  /// The motion of one number when it was overwritten.
  struct Kept {
    Moment moment;
    double step = 0.0;    // step in the last iteration
    double stop = 0.0;    // its stopping position
    double target = 0.0;  // its last target
  };
  /// A fading motion plus a minimum-jerk motion over the remaining distance.
  struct Way {
    Fading fading;
    double low = 0.0;  // the sum is clamped to low .. high
    double high = 0.0;
  };

  void measure() noexcept;
  double start_of(std::size_t number) const noexcept;
  double target_of(std::size_t number) const noexcept;
  Way way(std::size_t number, double iterations) const noexcept;
  double moved(std::size_t number, double time) const noexcept;
  void plain_state(double share, std::byte* out) noexcept;
  void mixed_state(double time, std::byte* out) noexcept;
  double share_of(double time) const noexcept {
    return profile_ == Profile::linear ? time : minimum_jerk(time);
  }

  const StateLayout& layout_;
  std::size_t stride_;               // [bytes]
  std::vector<std::uint64_t> ends_;  // from, to, and a state to blend into
  std::vector<double> exact_;        // exact start of each number, or NaN
  std::vector<double> starts_;
  std::vector<double> targets_;
  std::vector<double> values_;  // numbers of the last state()
  std::vector<Way> ways_;       // valid if `continues_`
  std::vector<Kept> kept_;
  double left_ = 0.0;  // iterations that the overwritten motion had left
  Iteration first_ = 0;
  Iteration last_ = 0;
  Iteration now_ = 0;
  double iterations_ = 1.0;
  Profile profile_ = Profile::linear;
  Pace pace_ = Pace::direct;
  bool continues_ = false;  // starts with the velocities of `kept_`
  bool moving_ = false;     // `kept_` is valid
  bool measured_ = false;   // `starts_` and `targets_` are valid
};

}  // namespace o80
