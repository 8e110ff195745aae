#include "driver/simulation.hpp"

#include <algorithm>
#include <string>
#include <utility>

#include "o80/base/error.hpp"

namespace o80::mujoco {
namespace {

double interpolated(double from, double to, double share) noexcept {
  return from + share * (to - from);
}

}  // namespace

Simulation::Simulation(const Config& config)
    : steps_(std::max(1U, config.steps)),
      model_(
          config, [&](mjSpec& spec) { add_extra_balls(spec, config.ball_options); },
          [&](mjModel& model) { switch_off_contacts(model, config.ball_options); }) {
  if (has_balls(config.ball_options)) balls_.emplace(*model_.model, config.ball_options);
  free_bodies_ =
      free_bodies_in(*model_.model, balls_ ? balls_->places() : std::vector<BallPlace>{});
  now_.targets.joints.resize(model_.imposed ? model_.joints.size() : 0);
  if (model_.face) now_.targets.states.resize(model_.face->schema.head.block);
  now_.targets.controls.resize(model_.controls.size());
  now_.joints.resize(now_.targets.joints.size());
  const std::size_t moved = now_.joints.size() + (balls_ ? balls_->degrees_of_freedom() : 0);
  integrates_ = moved != static_cast<std::size_t>(model_.model->nv) || model_.model->na != 0;
  const int* stages = model_.model->sensor_needstage;
  needs_forces_ =
      model_.face || std::count(stages, stages + model_.model->nsensor, mjSTAGE_ACC) > 0;
  data_.reset(mj_makeData(model_.model.get()));
  if (!data_) throw DriverError("there is not enough memory for the model");
  add_slots(config.slots);
  reset();
}

void Simulation::reset() noexcept {
  now_.clock = 0;
  now_.relaxed = false;
  now_.teleports = true;
  now_.strength = 1;
  forwarded_ = false;
  mj_resetDataKeyframe(model_.model.get(), data_.get(), model_.keyframe);
  if (model_.face) model_.face->hold(*data_);
  forward();
  for (std::size_t i = 0; i < now_.joints.size(); ++i) {
    const auto [position, velocity] = joint(i);
    const Line& line = model_.joints[i].line;
    now_.joints[i] = now_.targets.joints[i] = {line.back(position), velocity / line.factor};
  }
  for (std::size_t i = 0; i < now_.targets.controls.size(); ++i) {
    now_.targets.controls[i] = control(i);
  }
  if (balls_) balls_->reset(*data_);
  now_.engine_contacts = static_cast<std::uint32_t>(data_->ncon);
}

/// Computes all values that are read from the engine.
void Simulation::forward() noexcept {
  if (integrates_ || !model_.sensors.empty()) {
    mj_forward(model_.model.get(), data_.get());
  } else {
    mj_kinematics(model_.model.get(), data_.get());
  }
}

// targets => steps of engine, joints and balls => states and sensors
void Simulation::advance() noexcept {
  ++now_.clock;
  for (std::size_t i = 0; i < now_.targets.controls.size(); ++i) {
    data_->ctrl[model_.controls[i].address] = now_.targets.controls[i];
  }
  if (model_.face) model_.face->drive(now_.targets.states.data(), *data_);
  if (balls_) balls_->begin_iteration(period());
  if (now_.teleports && now_.targets.commanded) teleport_joints();
  for (std::uint32_t number = 0; number < steps_; ++number) step(number);
  now_.joints = now_.targets.joints;
  update_sensors();
  now_.engine_contacts = static_cast<std::uint32_t>(data_->ncon);
}

void Simulation::step(std::uint32_t number) noexcept {
  const double strength = now_.relaxed ? 0 : now_.strength;
  if (strength < 1) model_.face->weaken(strength, *model_.model, *data_);
  if (!integrates_) {
    data_->time += model_.model->opt.timestep;
  } else if (number == 0 && std::exchange(forwarded_, false)) {
    step_on();
  } else {
    mj_step(model_.model.get(), data_.get());
  }
  impose_joints(number);
  if (balls_) balls_->step(*data_, {now_.clock, number, steps_});
}

/// mj_step() after update_sensors(), without computing positions and velocities again.
void Simulation::step_on() noexcept {
  const mjModel* model = model_.model.get();
  mjData* data = data_.get();
  mj_checkPos(model, data);
  mj_checkVel(model, data);
  mj_forwardSkip(model, data, mjSTAGE_VEL, 1);
  mj_checkAcc(model, data);
  switch (model->opt.integrator) {
    case mjINT_EULER:
      return mj_Euler(model, data);
    case mjINT_RK4:
      return mj_RungeKutta(model, data, 4);
    default:
      return mj_implicit(model, data);
  }
}

/// Teleports imposed joints at the first commands, instead of sweeping them through bodies on the
/// way. Without bodies, surfaces have a teleport distance.
void Simulation::teleport_joints() noexcept {
  now_.teleports = false;
  if (!integrates_) return;
  forwarded_ = false;
  now_.joints = now_.targets.joints;
  for (std::size_t i = 0; i < now_.joints.size(); ++i) impose(i, now_.joints[i]);
}

void Simulation::impose(std::size_t i, const JointState& state) noexcept {
  const JointPlace& place = model_.joints[i];
  data_->qpos[place.position] = place.spread ? place.line.of(state.position) : state.position;
  data_->qvel[place.velocity] = place.spread ? place.line.factor * state.velocity : state.velocity;
}

void Simulation::impose_joints(std::uint32_t number) noexcept {
  if (now_.joints.empty() && !balls_) return;  // the next step begins with the kinematics
  const bool last = number + 1 == steps_;
  const double share = static_cast<double>(number + 1) / steps_;
  for (std::size_t i = 0; i < now_.joints.size(); ++i) {
    const JointState& from = now_.joints[i];
    const JointState& to = now_.targets.joints[i];
    impose(i, last ? to
                   : JointState{interpolated(from.position, to.position, share),
                                interpolated(from.velocity, to.velocity, share)});
  }
  mj_kinematics(model_.model.get(), data_.get());
}

/// Computes the sensors of the published state; the next step reuses the results.
void Simulation::update_sensors() noexcept {
  if (model_.sensors.empty()) return;
  const mjModel* model = model_.model.get();
  mjData* data = data_.get();
  if (needs_forces_) {
    mj_forward(model, data);
  } else {
    mj_fwdPosition(model, data);
    mj_sensorPos(model, data);
    mj_fwdVelocity(model, data);
    mj_sensorVel(model, data);
  }
  forwarded_ = true;
}

JointState Simulation::joint(std::size_t i) const noexcept {
  const JointPlace& place = model_.joints[i];
  return {data_->qpos[place.position], data_->qvel[place.velocity]};
}

double Simulation::control(std::size_t i) const noexcept {
  return data_->ctrl[model_.controls[i].address];
}

std::span<const double> Simulation::sensor(std::size_t i) const noexcept {
  const SensorPlace& place = model_.sensors[i];
  return {data_->sensordata + place.address, static_cast<std::size_t>(place.numbers)};
}

bool Simulation::diverged() const noexcept {
  return data_->warning[mjWARN_BADQPOS].number > 0 || data_->warning[mjWARN_BADQVEL].number > 0 ||
         data_->warning[mjWARN_BADQACC].number > 0;
}

}  // namespace o80::mujoco
