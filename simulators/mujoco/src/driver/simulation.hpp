#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "balls/ball_record.hpp"
#include "driver/model.hpp"

namespace o80::mujoco {

/// Position and velocity of a hinge or a slide.
struct JointState {
  double position = 0;
  double velocity = 0;
};
O80_DESCRIBE(JointState, (position, "[rad or m]"), (velocity, "[rad/s or m/s]", o80::rests_at(0)));

/// Where a ball is and how fast.
struct BallState {
  std::array<double, 3> position{};
  std::array<double, 3> velocity{};
};
O80_DESCRIBE(BallState, (position, "of the centre, in the world [m]"), (velocity, "[m/s]"));

/// What is asked of one ball in an iteration.
struct BallTarget {
  BallState state;
  bool imposed = false;  // else it flies freely, and `state` means nothing
};

/// What is asked in an iteration.
struct Targets {
  std::vector<JointState> joints;
  std::vector<double> controls;
  std::vector<BallTarget> balls;
};

/// A model in motion: imposed joints, controlled ones, balls with the law of impact of ours.
///
/// Move-only. Realtime: everything but the constructor; no allocation, no lock. All that changes is
/// kept in a snapshot: a restored simulation goes on bit for bit.
class Simulation {
 public:
  /// Throws DriverError.
  explicit Simulation(const Config& config);

  const Model& model() const noexcept { return model_; }
  /// Of the engine [s].
  double timestep() const noexcept { return model_.model->opt.timestep; }
  /// Length of an iteration [s].
  double period() const noexcept { return timestep() * config_.steps; }
  /// Of the engine in an iteration, at least 1.
  void steps(std::uint32_t count) noexcept { config_.steps = count; }
  /// What `advance` strives for; written before it.
  Targets& targets() noexcept { return now_.targets; }

  /// One iteration, of as many steps as the configuration says.
  void advance() noexcept;

  /// Back to the start.
  void reset() noexcept;
  bool snapshot(std::size_t slot) noexcept;
  /// False if nothing was kept there.
  bool restore(std::size_t slot) noexcept;
  std::size_t slots() const noexcept { return slots_.size(); }
  /// Forgets what happened to a ball.
  void clear(std::size_t ball) noexcept { now_.balls[ball].record = {}; }

  JointState joint(std::size_t i) const noexcept;
  double control(std::size_t i) const noexcept;
  BallState ball(std::size_t i) const noexcept;
  const BallRecord& record(std::size_t i) const noexcept { return now_.balls[i].record; }
  /// The racket met this ball in the last iteration, while it was imposed.
  bool released(std::size_t i) const noexcept { return now_.balls[i].released; }
  std::span<const double> sensor(std::size_t i) const noexcept;
  /// Where the first racket is and how it moves; null without one.
  const Pose* racket() const noexcept;
  /// Iterations since the start; a restore sets it back too.
  std::int64_t clock() const noexcept { return now_.clock; }
  /// Contacts between bodies that the engine sees.
  std::uint32_t engine_contacts() const noexcept { return static_cast<std::uint32_t>(data_->ncon); }
  /// A number is no number, or beyond all bounds: nothing good can follow.
  bool diverged() const noexcept;

 private:
  struct BallNow {
    Ball ball;
    BallRecord record;
    bool released = false;
  };
  /// Everything that changes, but for the engine's data.
  struct State {
    std::int64_t clock = 0;  // [iterations]
    Targets targets;
    std::vector<JointState> joints;  // as the last iteration left them
    std::vector<BallNow> balls;
    std::vector<Pose> poses;  // of the surfaces
  };
  struct Slot {
    DataPointer data;
    State state;
    bool filled = false;
  };

  void step(std::uint32_t k) noexcept;
  void impose_joints(std::uint32_t k) noexcept;
  void move_surfaces() noexcept;
  void move_ball(std::size_t i, std::uint32_t k) noexcept;
  void store_ball(std::size_t i) noexcept;
  Pose pose(const SurfacePlace& place) const noexcept;
  Ball imposed(const BallNow& now, const BallState& target) const noexcept;
  void look() noexcept;

  Config config_;
  Model model_;
  DataPointer data_;
  std::vector<Air> air_;  // for each ball
  std::vector<Surface> surfaces_;
  std::size_t rackets_ = 0;  // they come first
  State now_;
  std::vector<Ball> ball_starts_;  // of an iteration, for the balls that are imposed
  std::vector<Slot> slots_;
};

}  // namespace o80::mujoco
