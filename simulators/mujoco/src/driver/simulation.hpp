#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "balls/balls.hpp"
#include "driver/free_bodies.hpp"
#include "driver/model.hpp"

namespace o80::mujoco {

/// Position and velocity of a hinge or a slide.
struct JointState {
  double position = 0;
  double velocity = 0;
};
O80_DESCRIBE(JointState, (position, "[rad or m]"), (velocity, "[rad/s or m/s]", o80::rests_at(0)));

/// Targets of an iteration; `Balls` has the balls' targets.
struct Targets {
  std::vector<JointState> joints;  // imposed, in the numbers of their actuators
  bool commanded = false;          // whether a command moves one of them
  std::vector<double> controls;
  std::vector<std::byte> states;  // of mode actuated, as desired
};

/// Simulation of a model: the engine integrates everything but imposed joints and `Balls`.
///
/// Move-only. Realtime: everything but the constructor; no allocation, no lock. A snapshot holds
/// the complete state: a restored simulation continues bit for bit.
class Simulation {
 public:
  /// Throws DriverError.
  explicit Simulation(const Config& config);

  const Model& model() const noexcept { return model_; }
  /// Time step of the engine [s].
  double timestep() const noexcept { return model_.model->opt.timestep; }
  /// Duration of an iteration [s].
  double period() const noexcept { return timestep() * steps_; }
  /// Sets the steps of the engine in an iteration, at least 1.
  void steps(std::uint32_t count) noexcept { steps_ = count; }
  /// Sets the steps, and changes the engine's time step so that they last one period [s].
  void steps(std::uint32_t count, double period) {
    steps_ = count;
    model_.timestep(period / count);
    if (balls_) balls_->take(*model_.model);
  }
  /// Targets of the next `advance`.
  Targets& targets() noexcept { return now_.targets; }
  /// Relaxes or weakens actuators until a reset.
  void relax(bool relaxed) noexcept { now_.relaxed = relaxed; }
  bool relaxed() const noexcept { return now_.relaxed; }
  void strength(double share) noexcept { now_.strength = share; }
  /// Null if the options name none.
  Balls* balls() noexcept { return balls_ ? &*balls_ : nullptr; }
  const Balls* balls() const noexcept { return balls_ ? &*balls_ : nullptr; }

  const std::vector<FreeBody>& free_bodies() const noexcept { return free_bodies_; }
  Served place(const PlaceBody& request) noexcept {
    forwarded_ = false;
    return mujoco::place(*model_.model, *data_, free_bodies_, request);
  }

  /// Runs one iteration.
  void advance() noexcept;

  /// Returns to the start state.
  void reset() noexcept;
  /// False if there is no such slot.
  bool snapshot(std::size_t slot) noexcept;
  /// False if the slot holds no snapshot.
  bool restore(std::size_t slot) noexcept;
  std::size_t slots() const noexcept { return slots_.size(); }
  /// The snapshot in a slot; empty if the slot holds none.
  std::span<const std::byte> snapshot_bytes(std::size_t slot) const noexcept;
  /// Fills a slot; false if there is no such slot, or for bytes of another model.
  bool load_snapshot(std::size_t slot, std::span<const std::byte> bytes) noexcept;

  const mjData& data() const noexcept { return *data_; }
  JointState joint(std::size_t i) const noexcept;
  /// State of an imposed joint, in the numbers of its actuator.
  JointState imposed(std::size_t i) const noexcept { return now_.joints[i]; }
  double control(std::size_t i) const noexcept;
  std::span<const double> sensor(std::size_t i) const noexcept;
  /// Number of iterations since the start, also restored by a snapshot.
  std::int64_t clock() const noexcept { return now_.clock; }
  /// True if the engine integrates anything: a body that is neither imposed nor a ball.
  bool integrates() const noexcept { return integrates_; }
  /// Contacts between bodies in the engine, in the last step.
  std::uint32_t engine_contacts() const noexcept { return now_.engine_contacts; }
  /// True if a position, velocity or acceleration is not finite, or too large.
  bool diverged() const noexcept;

 private:
  /// State, except for the engine's data and the balls.
  struct State {
    std::int64_t clock = 0;  // [iterations]
    std::uint32_t engine_contacts = 0;
    bool relaxed = false;
    bool teleports = true;  // imposed joints, at their first command
    double strength = 1;    // share of the largest forces
    Targets targets;
    std::vector<JointState> joints;  // imposed ones, at the end of the last iteration
  };
  struct Slot {
    std::vector<std::byte> bytes;
    bool filled = false;
  };

  void add_slots(std::uint32_t count);
  template <class Bytes>
  void each_part(Bytes& bytes) noexcept;
  void forward() noexcept;
  void step(std::uint32_t number) noexcept;
  void step_on() noexcept;
  void teleport_joints() noexcept;
  void impose_joints(std::uint32_t number) noexcept;
  void impose(std::size_t i, const JointState& state) noexcept;
  void update_sensors() noexcept;

  std::uint32_t steps_;
  Model model_;
  std::optional<Balls> balls_;
  std::vector<FreeBody> free_bodies_;
  bool integrates_;
  DataPointer data_;
  State now_;
  bool needs_forces_;       // rows contain values that follow from forces
  bool forwarded_ = false;  // sensors are up to date
  std::vector<Slot> slots_;
  std::vector<mjtNum> engine_state_;  // of a snapshot
};

}  // namespace o80::mujoco
