#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "o80/control/interpolation.hpp"
#include "o80/control/record.hpp"
#include "o80/control/state_layout.hpp"

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

  /// Sets out at `first` for `iterations`; a minimum jerk continues what `keep_moving` kept.
  void begin(Iteration first, std::int64_t iterations, Profile profile, Pace pace) noexcept;
  /// The state at an iteration: the target, bit for bit, from the last one on.
  void state(Iteration iteration, std::byte* out) noexcept;
  Iteration last() const noexcept { return last_; }

  /// Remembers velocity and acceleration of the iteration just given, for what overwrites it.
  void keep_moving() noexcept;
  /// What comes next starts at rest.
  void rest() noexcept { moving_ = false; }
  /// What comes next starts with this; of the first number.
  Moment first_moment() const noexcept { return moving_ ? moments_.front() : Moment{}; }

 private:
  void measure() noexcept;
  void plain_state(double share, std::byte* out) const noexcept;
  void mixed_state(double share, double time, std::byte* out) const noexcept;
  double moved(std::size_t number, double share, double time) const noexcept;
  double share_of(double time) const noexcept {
    return profile_ == Profile::linear ? time : minimum_jerk(time);
  }

  const StateLayout& layout_;
  std::size_t stride_;               // [bytes]
  std::vector<std::uint64_t> ends_;  // from, to, and a state to blend into
  std::vector<double> starts_;       // one for each number
  std::vector<double> targets_;
  std::vector<Quintic> ways_;
  std::vector<Moment> moments_;  // kept of what was overwritten
  Iteration first_ = 0;
  Iteration last_ = 0;
  Iteration now_ = 0;
  double iterations_ = 1.0;
  Profile profile_ = Profile::linear;
  Pace pace_ = Pace::direct;
  bool quintic_ = false;  // sets out with a velocity
  bool moving_ = false;
  bool measured_ = false;  // the ways are known
};

}  // namespace o80
