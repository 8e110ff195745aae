#include "driver/simulation.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include "o80/base/error.hpp"

namespace o80::mujoco {
namespace {

double between(double from, double to, double share) noexcept { return from + share * (to - from); }

/// Turned by more than its spin says, beyond this, a body was put there [rad].
constexpr double kTurnedByHand = 0.5;

/// The motion to a pose that the body was put into: as its velocity says.
Motion put(const Pose& pose, double step) noexcept {
  Pose from = pose;
  from.position = pose.position - step * pose.velocity;
  return {from, pose};
}

bool was_put(const Pose& from, const Pose& to, double step, double jump) noexcept {
  const Vector led = from.position + (0.5 * step) * (from.velocity + to.velocity);
  if (length(to.position - led) > jump) return true;
  const double turned = turn_between(from.rotation, to.rotation).angle;
  return turned > 0.5 * step * (length(from.spin) + length(to.spin)) + kTurnedByHand;
}

}  // namespace

Simulation::Simulation(const Config& config) : config_(config), model_(config) {
  config_.steps = std::max(1U, config.steps);
  data_.reset(mj_makeData(model_.model.get()));
  if (!data_) throw DriverError("there is no memory for the model's data");
  const mjtNum* gravity = model_.model->opt.gravity;
  for (const BallPlace& ball : model_.balls) {
    air_.push_back(Air::of(config.air_density, config.drag_coefficient, config.lift_coefficient,
                           ball.radius, ball.mass, config.spin_decay,
                           {gravity[0], gravity[1], gravity[2]}));
  }
  for (const SurfacePlace& place : model_.surfaces) {
    surfaces_.push_back({place.kind, place.shape, place.restitution, {}});
    if (place.kind == SurfaceKind::racket) ++rackets_;
  }
  now_.targets.joints.resize(model_.controls.empty() ? model_.joints.size() : 0);
  now_.targets.controls.resize(model_.controls.size());
  now_.targets.balls.resize(model_.balls.size());
  now_.joints.resize(now_.targets.joints.size());
  now_.balls.resize(model_.balls.size());
  now_.poses.resize(surfaces_.size());
  ball_starts_.resize(model_.balls.size());
  slots_.resize(config.slots);
  for (Slot& slot : slots_) {
    slot.data.reset(mj_makeData(model_.model.get()));
    if (!slot.data) throw DriverError("there is no memory for so many slots: give fewer (slots=)");
    slot.state = now_;
  }
  reset();
}

void Simulation::reset() noexcept {
  now_.clock = 0;
  mj_resetDataKeyframe(model_.model.get(), data_.get(), model_.keyframe);
  mj_forward(model_.model.get(), data_.get());
  for (std::size_t i = 0; i < now_.joints.size(); ++i) {
    now_.joints[i] = now_.targets.joints[i] = joint(i);
  }
  for (std::size_t i = 0; i < now_.targets.controls.size(); ++i) {
    now_.targets.controls[i] = control(i);
  }
  for (std::size_t i = 0; i < now_.poses.size(); ++i) {
    now_.poses[i] = pose(model_.surfaces[i]);
    surfaces_[i].motion = {now_.poses[i], now_.poses[i]};
  }
  for (std::size_t i = 0; i < now_.balls.size(); ++i) {
    const BallPlace& place = model_.balls[i];
    const mjtNum* position = data_->qpos + place.position;
    const mjtNum* velocity = data_->qvel + place.velocity;
    BallNow& now = now_.balls[i];
    now = {.ball = {.position = {position[0], position[1], position[2]},
                    .velocity = {velocity[0], velocity[1], velocity[2]},
                    .spin = vector(config_.spin)},
           .record = {},
           .released = false};
    now_.targets.balls[i] = {ball(i), false};
    for (const Surface& surface : surfaces_) {
      const Near here = near(surface.shape, surface.motion.inside(now.ball.position, 1));
      note_gap(now.record, surface, std::max(0.0, here.distance - place.radius));
    }
  }
}

bool Simulation::snapshot(std::size_t slot) noexcept {
  if (slot >= slots_.size()) return false;
  mj_copyData(slots_[slot].data.get(), model_.model.get(), data_.get());
  slots_[slot].state = now_;
  slots_[slot].filled = true;
  return true;
}

bool Simulation::restore(std::size_t slot) noexcept {
  if (slot >= slots_.size() || !slots_[slot].filled) return false;
  mj_copyData(data_.get(), model_.model.get(), slots_[slot].data.get());
  now_ = slots_[slot].state;
  return true;
}

// targets => steps of engine, joints, surfaces and balls => what came of it
void Simulation::advance() noexcept {
  ++now_.clock;
  for (std::size_t i = 0; i < now_.targets.controls.size(); ++i) {
    data_->ctrl[model_.controls[i].address] = now_.targets.controls[i];
  }
  for (std::size_t i = 0; i < now_.balls.size(); ++i) {
    now_.balls[i].released = false;
    const BallTarget& target = now_.targets.balls[i];
    if (target.imposed) ball_starts_[i] = imposed(now_.balls[i], target.state);
  }
  for (std::uint32_t k = 0; k < config_.steps; ++k) step(k);
  now_.joints = now_.targets.joints;
  look();
}

void Simulation::step(std::uint32_t k) noexcept {
  if (model_.driven) {
    data_->time += model_.model->opt.timestep;
  } else {
    mj_step(model_.model.get(), data_.get());
  }
  impose_joints(k);
  move_surfaces();
  for (std::size_t i = 0; i < now_.balls.size(); ++i) move_ball(i, k);
}

void Simulation::impose_joints(std::uint32_t k) noexcept {
  const bool last = k + 1 == config_.steps;
  const double share = static_cast<double>(k + 1) / config_.steps;
  for (std::size_t i = 0; i < now_.joints.size(); ++i) {
    const JointState& from = now_.joints[i];
    const JointState& to = now_.targets.joints[i];
    const JointPlace& place = model_.joints[i];
    data_->qpos[place.position] = last ? to.position : between(from.position, to.position, share);
    data_->qvel[place.velocity] = last ? to.velocity : between(from.velocity, to.velocity, share);
  }
  mj_kinematics(model_.model.get(), data_.get());
  mj_comPos(model_.model.get(), data_.get());
  mj_comVel(model_.model.get(), data_.get());
}

void Simulation::move_surfaces() noexcept {
  const double step = model_.model->opt.timestep;
  for (std::size_t i = 0; i < surfaces_.size(); ++i) {
    if (model_.surfaces[i].still) continue;
    const Pose to = pose(model_.surfaces[i]);
    Pose& from = now_.poses[i];
    surfaces_[i].motion =
        was_put(from, to, step, config_.jump / config_.steps) ? put(to, step) : Motion(from, to);
    from = to;
  }
}

/// Where the way to a target begins: where the ball is, unless it was put elsewhere.
Ball Simulation::imposed(const BallNow& now, const BallState& target) const noexcept {
  const Vector to = vector(target.position);
  const Vector velocity = vector(target.velocity);
  const Vector led = now.ball.position + (0.5 * period()) * (now.ball.velocity + velocity);
  if (length(to - led) <= config_.jump) return now.ball;
  return {to - period() * velocity, velocity, {}};
}

void Simulation::move_ball(std::size_t i, std::uint32_t k) noexcept {
  const double step = model_.model->opt.timestep;
  const double radius = model_.balls[i].radius;
  const BallTarget& target = now_.targets.balls[i];
  BallNow& now = now_.balls[i];
  const Moment moment{now_.clock, static_cast<double>(k) / config_.steps, 1.0 / config_.steps};
  const auto impact = [&](const Surface& surface, const Touch& touch, const Ball& before,
                          const Ball& after) {
    note(now.record, moment, surface, touch, before, after);
  };
  const auto passed = [&](const Surface& surface, double gap) {
    note_gap(now.record, surface, gap);
  };
  const auto fly = [&](const Ball& ball, double begin) {
    now.ball = flown_among(surfaces_, ball, air_[i], radius, step, begin, impact, passed);
  };

  if (!target.imposed || now.released) {
    fly(now.ball, 0);
  } else {
    // a straight way to where it is asked to be, unless a racket is on it
    const Ball& start = ball_starts_[i];
    const double from = moment.begin;
    const bool last = k + 1 == config_.steps;
    const double to = last ? 1.0 : from + moment.share;
    const Vector end = vector(target.state.position);
    const Vector velocity = vector(target.state.velocity);
    const Vector spin = vector(config_.spin);
    Path path;
    path.from = k == 0 ? start.position : mujoco::between(start.position, end, from);
    path.velocity_from = k == 0 ? start.velocity : mujoco::between(start.velocity, velocity, from);
    path.to = last ? end : mujoco::between(start.position, end, to);
    path.velocity_to = last ? velocity : mujoco::between(start.velocity, velocity, to);
    now.ball = {path.to, path.velocity_to, spin};

    const Surface* met = nullptr;
    Touch touch;
    for (const Surface& surface : std::span(surfaces_).first(rackets_)) {
      const Swept swept = sweep(surface, path, radius);
      passed(surface, swept.smallest);
      if (swept.touch && (met == nullptr || swept.touch->share < touch.share)) {
        met = &surface;
        touch = *swept.touch;
      }
    }
    if (met != nullptr) {
      const Ball before{path.position(touch.share), path.velocity(touch.share), spin};
      const Ball after = bounced(before, touch, *met);
      impact(*met, touch, before, after);
      now.released = true;
      fly(after, touch.share);
    }
  }
  if (now.record.count > 0) {
    now.record.largest_speed = std::max(now.record.largest_speed, length(now.ball.velocity));
  }
  store_ball(i);
}

void Simulation::store_ball(std::size_t i) noexcept {
  const Ball& ball = now_.balls[i].ball;
  mjtNum* position = data_->qpos + model_.balls[i].position;
  mjtNum* velocity = data_->qvel + model_.balls[i].velocity;
  for (int axis = 0; axis < 3; ++axis) {
    position[axis] = ball.position[axis];
    velocity[axis] = ball.velocity[axis];
    velocity[3 + axis] = 0;
  }
}

/// Sensors see the state that is published.
void Simulation::look() noexcept {
  if (!model_.sensors.empty()) mj_forward(model_.model.get(), data_.get());
}

Pose Simulation::pose(const SurfacePlace& place) const noexcept {
  const mjtNum* position = data_->geom_xpos + 3 * static_cast<std::ptrdiff_t>(place.geom);
  const mjtNum* matrix = data_->geom_xmat + 9 * static_cast<std::ptrdiff_t>(place.geom);
  Pose pose;
  pose.position = {position[0], position[1], position[2]};
  std::copy_n(matrix, 9, pose.rotation.m.begin());
  if (!place.still) {
    mjtNum velocity[6];
    mj_objectVelocity(model_.model.get(), data_.get(), mjOBJ_GEOM, place.geom, velocity, 0);
    pose.spin = {velocity[0], velocity[1], velocity[2]};
    pose.velocity = {velocity[3], velocity[4], velocity[5]};
  }
  return pose;
}

JointState Simulation::joint(std::size_t i) const noexcept {
  const JointPlace& place = model_.joints[i];
  return {data_->qpos[place.position], data_->qvel[place.velocity]};
}

double Simulation::control(std::size_t i) const noexcept {
  return data_->ctrl[model_.controls[i].address];
}

BallState Simulation::ball(std::size_t i) const noexcept {
  return {numbers(now_.balls[i].ball.position), numbers(now_.balls[i].ball.velocity)};
}

std::span<const double> Simulation::sensor(std::size_t i) const noexcept {
  const SensorPlace& place = model_.sensors[i];
  return {data_->sensordata + place.address, static_cast<std::size_t>(place.numbers)};
}

const Pose* Simulation::racket() const noexcept {
  return rackets_ == 0 ? nullptr : now_.poses.data();
}

bool Simulation::diverged() const noexcept {
  return data_->warning[mjWARN_BADQPOS].number > 0 || data_->warning[mjWARN_BADQVEL].number > 0 ||
         data_->warning[mjWARN_BADQACC].number > 0;
}

}  // namespace o80::mujoco
