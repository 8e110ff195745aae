#include "driver/driver.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "driver/steps_in_period.hpp"

namespace o80::mujoco {
namespace {

/// Adds an array of actuators, named as the members of the model; returns the place of each.
template <class T, class Member>
std::vector<Place<T>> add_group(Schema& schema, std::string_view group,
                                const std::vector<Member>& members) {
  if (members.empty()) return {};
  const auto first = static_cast<std::uint32_t>(schema.actuators.size());
  const auto count = static_cast<std::uint32_t>(members.size());
  schema.add_actuators(group, describing::type_of<T>(schema), count);
  std::vector<Place<T>> places(count);
  for (std::uint32_t i = 0; i < count; ++i) {
    schema.actuator(first + i).name(members[i].name).when_idle(WhenIdle::hold);
    places[i].offset = schema.actuators[first + i].offset;
  }
  return places;
}

/// Adds the states of joints as a sensor value; returns the place of each.
std::vector<Place<JointState>> add_joint_sensors(Schema& schema, std::size_t count) {
  FieldRow field = scalar_field("joints", Kind::structure, "in the model's order",
                                static_cast<std::uint32_t>(count));
  field.type = describing::type_of<JointState>(schema);
  const std::uint32_t first = schema.add_sensor(field);
  std::vector<Place<JointState>> places(count);
  for (std::size_t i = 0; i < count; ++i) {
    places[i].offset = first + static_cast<std::uint32_t>(i * sizeof(JointState));
  }
  return places;
}

}  // namespace

MujocoDriver::MujocoDriver(const Config& config) : simulation_(config), steps_(config.steps) {
  Schema schema;
  places_ = add_to(schema);
}

MujocoDriver::Places MujocoDriver::add_to(Schema& schema) const {
  Places places;
  add_actuators(schema, places);
  add_sensors(schema, places);
  show(schema, places);
  return places;
}

/// Names the model for viewers, and the values that move its joints and balls.
void MujocoDriver::show(Schema& schema, const Places& places) const {
  const Model& model = simulation_.model();
  schema.shown.mjcf = model.mjcf;
  schema.shown.file = model.file;
  for (std::size_t i = 0; i < places.joints.size(); ++i) {
    schema.shown.joint(model.joints[i].name, places.joints[i].offset);
  }
  for (std::size_t i = 0; i < places.joint_sensors.size(); ++i) {
    schema.shown.joint(model.joints[i].name, places.joint_sensors[i].offset, ShownFrom::extended);
  }
  if (const Balls* balls = simulation_.balls()) places.balls.show(schema.shown, *balls);
}

void MujocoDriver::add_actuators(Schema& schema, Places& places) const {
  const Model& model = simulation_.model();
  if (model.controls.empty()) places.joints = add_group<JointState>(schema, "joints", model.joints);
  const auto first_control = static_cast<std::uint32_t>(schema.actuators.size());
  places.controls = add_group<double>(schema, "controls", model.controls);
  for (std::uint32_t i = 0; i < model.controls.size(); ++i) {
    const ControlPlace& control = model.controls[i];
    if (!control.limited) continue;
    schema.actuator(first_control + i)
        .limits({.minimum = control.minimum, .maximum = control.maximum});
  }
  if (const Balls* balls = simulation_.balls()) places.balls.add_actuators(schema, *balls);
}

void MujocoDriver::add_sensors(Schema& schema, Places& places) const {
  const Model& model = simulation_.model();
  if (const Balls* balls = simulation_.balls()) places.balls.add_sensors(schema, *balls);
  places.clock.offset = schema.add_sensor(scalar_field(
      "clock", Kind::int64, "iterations since the start or a reset; a restore sets it back too"));
  if (!model.controls.empty() && !model.joints.empty()) {
    places.joint_sensors = add_joint_sensors(schema, model.joints.size());
  }
  if (simulation_.integrates()) {
    places.engine_contacts.offset = schema.add_sensor(
        scalar_field("engine_contacts", Kind::uint32, "contacts between bodies in the engine"));
  }
  for (const SensorPlace& sensor : model.sensors) {
    const auto rows = static_cast<std::uint32_t>(sensor.numbers == 1 ? 0 : sensor.numbers);
    places.sensors.push_back(
        {schema.add_sensor(scalar_field(sensor.name, Kind::float64, "sensor of the model", rows))});
  }
}

void MujocoDriver::describe(Schema& schema) const {
  (void)add_to(schema);
  const std::int64_t requested = schema.asked_period();
  const double timestep = simulation_.timestep();
  const std::uint32_t steps =
      requested == 0 ? std::max(1U, steps_) : steps_in_period(requested, timestep, steps_);
  schema.period(std::llround(steps * (timestep * 1e9)));
}

// desired => targets => one iteration
void MujocoDriver::write(const Desired<MujocoDriver>& desired) {
  if (!steps_known_) {
    simulation_.steps(
        steps_in_period(std::llround(desired.period() * 1e9), simulation_.timestep(), steps_));
    steps_known_ = true;
  }
  Targets& targets = simulation_.targets();
  for (std::size_t i = 0; i < places_.joints.size(); ++i) {
    targets.joints[i] = desired.at(places_.joints[i]);
  }
  for (std::size_t i = 0; i < places_.controls.size(); ++i) {
    targets.controls[i] = desired.at(places_.controls[i]);
  }
  if (Balls* balls = simulation_.balls()) places_.balls.write(desired, *balls);
  simulation_.advance();
}

void MujocoDriver::read(Reading<MujocoDriver>& reading) {
  for (std::size_t i = 0; i < places_.joints.size(); ++i) {
    reading.observe(places_.joints[i], simulation_.joint(i));
  }
  for (std::size_t i = 0; i < places_.controls.size(); ++i) {
    reading.observe(places_.controls[i], simulation_.control(i));
  }
  if (const Balls* balls = simulation_.balls()) places_.balls.read(*balls, reading);
  read_sensors(reading);
  if (reading.fresh()) go_on_from_targets(reading);
  if (simulation_.diverged()) {
    reading.fault(
        "the simulation diverged: a position, velocity or acceleration is not finite or too large. "
        "Give it a smaller timestep and more steps, or gentler commands");
  }
}

void MujocoDriver::read_sensors(Reading<MujocoDriver>& reading) const {
  reading.extend(places_.clock, simulation_.clock());
  for (std::size_t i = 0; i < places_.joint_sensors.size(); ++i) {
    reading.extend(places_.joint_sensors[i], simulation_.joint(i));
  }
  if (simulation_.integrates()) {
    reading.extend(places_.engine_contacts, simulation_.engine_contacts());
  }
  for (std::size_t i = 0; i < places_.sensors.size(); ++i) {
    Number at = places_.sensors[i];
    for (const double number : simulation_.sensor(i)) {
      reading.extend(at, number);
      at.offset += sizeof(double);
    }
  }
}

/// After a reset or a restore the desired states are the last targets of the restored state.
void MujocoDriver::go_on_from_targets(Reading<MujocoDriver>& reading) {
  const Targets& targets = simulation_.targets();
  std::byte* desired = reading.desired_bytes();
  for (std::size_t i = 0; i < places_.joints.size(); ++i) {
    pack(targets.joints[i], desired + places_.joints[i].offset);
  }
  for (std::size_t i = 0; i < places_.controls.size(); ++i) {
    pack(targets.controls[i], desired + places_.controls[i].offset);
  }
  if (const Balls* balls = simulation_.balls()) places_.balls.go_on_from_targets(*balls, desired);
}

Served MujocoDriver::on(const Reset&) noexcept {
  simulation_.reset();  // the start state has no random part: the seed has no effect
  return Served::start_afresh();
}

Served MujocoDriver::on(const Snapshot& snapshot) noexcept {
  return simulation_.snapshot(snapshot.slot) ? Served::done() : no_such_slot();
}

Served MujocoDriver::on(const Restore& restore) noexcept {
  if (restore.slot >= simulation_.slots()) return no_such_slot();
  if (simulation_.restore(restore.slot)) return Served::start_afresh();
  return Served::rejected("this slot holds no snapshot: send the request snapshot first");
}

Served MujocoDriver::on(const ClearContacts& which) noexcept {
  return clear_contacts(simulation_.balls(), which);
}

Served MujocoDriver::on(const FlyOut& request) noexcept {
  return fly_out(simulation_.balls(), request);
}

Served MujocoDriver::no_such_slot() const noexcept {
  char text[160];
  std::snprintf(text, sizeof text,
                "there are %zu slots, counted from 0; start the simulator with more (slots=...)",
                simulation_.slots());
  return Served::rejected(text);
}

}  // namespace o80::mujoco
