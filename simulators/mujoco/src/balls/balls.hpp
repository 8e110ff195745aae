#pragma once

#include <mujoco/mujoco.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "balls/ball_model.hpp"
#include "balls/bouncing_flight.hpp"
#include "balls/carried.hpp"
#include "balls/contact_record.hpp"
#include "balls/fly_out.hpp"

namespace o80::mujoco {

/// State of a ball as an actuator.
struct BallState {
  std::array<double, 3> position{};
  std::array<double, 3> velocity{};
  std::array<double, 3> spin{};
};
O80_DESCRIBE(BallState, (position, "of the centre, in the world [m]"), (velocity, "[m/s]"),
             (spin, "[rad/s], in the world's axes"));

/// Target of one ball in an iteration.
struct BallTarget {
  BallState state;
  bool imposed = false;  // false: the ball flies freely, and `state` has no meaning
};

/// Balls of a simulation: imposed, or in free flight among moving surfaces. The engine does not
/// compute their contacts: between its steps, each ball is moved by the laws of
/// flight (ball_flight.hpp) and bounce (bounce.hpp).
///
/// Realtime: everything but the constructor; no allocation, no lock.
class Balls {
 public:
  struct BallNow {
    Ball ball;
    bool released = false;
    bool flies_out = false;  // flies out in the next iteration
    FlyOut fly_out{};
  };
  /// Complete state; a restored state repeats bit for bit.
  struct State {
    std::vector<BallTarget> targets;
    std::vector<BallNow> balls;
    std::vector<WatchedContacts> watched;  // of each ball, in the order of the watched surfaces
    std::vector<SurfaceContacts> others;   // of each ball, in the order of the other surfaces
    std::vector<Pose> poses;               // of the surfaces, watched ones first
  };

  /// Switches off the engine's contacts of balls in `model`, which must outlive this object.
  /// Throws DriverError.
  Balls(const mjModel& model, const BallOptions& options);

  std::size_t size() const noexcept { return places_.size(); }
  /// Degrees of freedom of the balls, which the engine need not integrate.
  std::size_t degrees_of_freedom() const noexcept { return 6 * size(); }
  const std::vector<BallPlace>& places() const noexcept { return places_; }
  /// Surfaces in the order of the option.
  const std::vector<SurfacePlace>& surfaces() const noexcept { return surface_places_; }

  std::vector<BallTarget>& targets() noexcept { return now_.targets; }
  const std::vector<BallTarget>& targets() const noexcept { return now_.targets; }
  BallState ball(std::size_t i) const noexcept;
  /// Whether a watched surface ended the imposed motion of this ball in the last iteration.
  bool released(std::size_t i) const noexcept { return now_.balls[i].released; }
  std::span<const WatchedContacts> watched_contacts(std::size_t i) const noexcept;
  std::span<const SurfaceContacts> other_contacts(std::size_t i) const noexcept;

  /// Reads the start state of balls and surfaces from the engine.
  void reset(const mjData& data) noexcept;
  /// Clears the records of a ball.
  void clear(std::size_t i) noexcept { records(i).clear(); }
  /// True if a command moved the ball to the end of the last iteration.
  bool imposed(std::size_t i) const noexcept {
    return now_.targets[i].imposed && !now_.balls[i].released;
  }
  /// Makes the ball fly out in the next iteration, unless a command moves it then.
  void fly_out(const FlyOut& request) noexcept {
    now_.balls[request.ball - 1].flies_out = true;
    now_.balls[request.ball - 1].fly_out = request;
  }
  /// Begins an iteration of `period` [s] towards the targets.
  void begin_iteration(double period) noexcept;
  /// Moves all balls by a step, after the engine has moved the surfaces.
  void step(mjData& data, const StepOfIteration& step) noexcept;

  /// Continues with a copy of the model with another time step, which must outlive this object.
  void take(const mjModel& model) noexcept { model_ = &model; }

  State& state() noexcept { return now_; }

 private:
  /// Surface, and its geom.
  struct Follower {
    int geom;
    bool still;
    std::vector<int> joints;  // that carry it
  };

  void add_surfaces();
  ContactRecords records(std::size_t i) noexcept;
  Pose pose(const mjData& data, const Follower& follower) const noexcept;
  void move_surfaces(const mjData& data, std::uint32_t steps) noexcept;
  Ball start_of_imposed(const Ball& now, const BallState& target) const noexcept;
  Path imposed_path(std::size_t i, const StepOfIteration& step) const noexcept;
  void impose(std::size_t i, const StepOfIteration& step) noexcept;
  std::span<const Surface> all_surfaces() const noexcept { return surfaces_; }
  /// Surfaces that are part of the world.
  std::span<const Surface> still_surfaces() const noexcept {
    return all_surfaces().subspan(moving_);
  }
  /// Returns true after a bounce.
  bool fly(std::size_t i, const Ball& from, double begin, const StepOfIteration& step,
           std::span<const Surface> among) noexcept;
  void fly_out(std::size_t i, const StepOfIteration& step) noexcept;
  void store(mjData& data, std::size_t i) const noexcept;

  const mjModel* model_;
  double teleport_distance_;
  Vector spin_;
  double period_ = 0;  // of an iteration [s]
  std::vector<BallPlace> places_;
  std::vector<Air> air_;  // for each ball
  std::vector<SurfacePlace> surface_places_;
  std::vector<Surface> surfaces_;  // watched ones first, then the others that move
  std::vector<Follower> followers_;
  std::size_t watched_ = 0;  // how many
  std::size_t moving_ = 0;   // how many, watched ones included
  State now_;
  std::vector<Ball> imposed_starts_;  // of this iteration
};

}  // namespace o80::mujoco
