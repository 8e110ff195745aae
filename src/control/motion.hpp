#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "control/interpolation.hpp"
#include "control/record.hpp"
#include "control/state_layout.hpp"

namespace o80 {

/// The way of one actuator from one state to the next.
///
/// Realtime: everything but construction.
class Motion {
 public:
  explicit Motion(const StateLayout& layout);

  /// The two ends, to be filled before `begin`.
  std::byte* from() noexcept { return reinterpret_cast<std::byte*>(ends_.data()); }
  std::byte* to() noexcept { return from() + stride_; }

  /// Where one number really is, which `from` rounds to its kind; to be said before `begin`.
  void start_at(std::size_t number, double value) noexcept { exact_[number] = value; }
  /// Nothing of that: all of it starts at `from`.
  void start_at_from() noexcept;
  /// How far one number has to go.
  double distance(std::size_t number) const noexcept;
  /// Sets out at `first` for `iterations`; a minimum jerk continues what `keep_moving` kept.
  void begin(Iteration first, std::int64_t iterations, Profile profile, Pace pace) noexcept;
  /// The state at an iteration: the target, bit for bit, from the last one on.
  void state(Iteration iteration, std::byte* out) noexcept;
  /// One number of the state just given, before it is rounded to its kind.
  double number(std::size_t number) const noexcept;
  Iteration last() const noexcept { return last_; }
  /// The state just given is the target.
  bool arrived() const noexcept { return now_ >= last_; }

  /// Remembers how the state just given moves, for what overwrites it. It would have gone on
  /// through so many rows more, to the one `ahead` (or to its target).
  void keep_moving(const std::byte* ahead, std::int64_t rows) noexcept;
  /// The same for one number of `state` that did not go its way: how it moves, where it would stop,
  /// and in how many iterations.
  void keep_moving(const std::byte* state, std::size_t number, const Moment& moment, double stop,
                   std::int64_t iterations) noexcept;
  /// How far one number went in the last iteration before `keep_moving`.
  double kept_step(std::size_t number) const noexcept { return moving_ ? kept_[number].step : 0.0; }
  /// The numbers whose bits are not set do not move on.
  void leave_out(const std::uint64_t* mask) noexcept;
  /// What comes next starts at rest.
  void rest() noexcept { moving_ = false; }

  /// Iterations of a minimum jerk at whose start `number` moves as was kept, and that is never
  /// faster than `speed` [1/iteration], or than it was if that is faster.
  std::int64_t iterations_at(std::size_t number, double speed) noexcept;

 private:
  /// How one number was moving when it was overwritten.
  struct Kept {
    Moment moment;
    double step = 0.0;    // what it went in the last iteration
    double stop = 0.0;    // where it would have come to rest ...
    double target = 0.0;  // ... before it had gone on to its target
  };
  /// A fading motion, and a minimum jerk from where it ends.
  struct Way {
    Fading fading;
    double low = 0.0;  // the span that is never left
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
  std::vector<double> exact_;        // one for each number: where it starts, or NaN
  std::vector<double> starts_;
  std::vector<double> targets_;
  std::vector<double> values_;  // of the state just given
  std::vector<Way> ways_;       // of a motion that sets out with a velocity
  std::vector<Kept> kept_;
  double left_ = 0.0;  // iterations that what was overwritten had left
  Iteration first_ = 0;
  Iteration last_ = 0;
  Iteration now_ = 0;
  double iterations_ = 1.0;
  Profile profile_ = Profile::linear;
  Pace pace_ = Pace::direct;
  bool continues_ = false;  // sets out with a velocity
  bool moving_ = false;     // something is kept
  bool measured_ = false;   // starts and targets are known
};

}  // namespace o80
