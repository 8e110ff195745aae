#include "driver/driver.hpp"

#include <cmath>
#include <cstdio>

namespace o80::mujoco {
namespace {

/// Share of a period: what rounding takes from a printed frequency.
constexpr double kPeriodTolerance = 1e-5;

FieldRow structure(std::string_view name, std::uint32_t type, std::size_t count,
                   std::string_view text) {
  FieldRow field = scalar_field(name, Kind::structure, text, static_cast<std::uint32_t>(count));
  field.type = type;
  return field;
}

template <class T>
std::vector<Place<T>> places(std::uint32_t first, std::size_t count) {
  std::vector<Place<T>> all(count);
  for (std::size_t i = 0; i < count; ++i) {
    all[i].offset = first + static_cast<std::uint32_t>(i * sizeof(T));
  }
  return all;
}

/// Adds a group of actuators with names of their own; gives the place of each.
template <class T, class Named>
std::vector<Place<T>> add_group(Schema& schema, std::string_view group,
                                const std::vector<Named>& members, WhenIdle when_idle) {
  if (members.empty()) return {};
  const auto first = static_cast<std::uint32_t>(schema.actuators.size());
  const auto count = static_cast<std::uint32_t>(members.size());
  schema.add_actuators(group, describing::type_of<T>(schema), count);
  std::vector<Place<T>> all(count);
  for (std::uint32_t i = 0; i < count; ++i) {
    schema.actuator(first + i).name(members[i].name).when_idle(when_idle);
    all[i].offset = schema.actuators[first + i].offset;
  }
  return all;
}

}  // namespace

MujocoDriver::MujocoDriver(const Config& config) : simulation_(config), steps_(config.steps) {
  Schema schema;
  places_ = add_to(schema);
}

MujocoDriver::Places MujocoDriver::add_to(Schema& schema) const {
  const Model& model = simulation_.model();
  const bool imposed = model.controls.empty();
  Places at;

  // actuators
  if (imposed) at.joints = add_group<JointState>(schema, "joints", model.joints, WhenIdle::hold);
  const auto first_control = static_cast<std::uint32_t>(schema.actuators.size());
  at.controls = add_group<double>(schema, "controls", model.controls, WhenIdle::hold);
  for (std::uint32_t i = 0; i < model.controls.size(); ++i) {
    const ControlPlace& control = model.controls[i];
    if (!control.limited) continue;
    schema.actuator(first_control + i)
        .limits({.minimum = control.minimum, .maximum = control.maximum});
  }
  at.first_ball = static_cast<std::uint32_t>(schema.actuators.size());
  at.balls = add_group<BallState>(schema, "balls", model.balls, WhenIdle::follow);

  // sensor values
  if (!model.balls.empty()) {
    const std::uint32_t type = describing::type_of<BallRecord>(schema);
    const std::uint32_t first = schema.add_sensor(
        structure("contacts", type, model.balls.size(), "what happened to each ball"));
    at.records = places<BallRecord>(first, model.balls.size());
  }
  at.clock.offset = schema.add_sensor(scalar_field(
      "clock", Kind::int64, "iterations since the start or a reset; a restore sets it back too"));
  if (simulation_.racket() != nullptr) {
    at.racket_position.offset = schema.add_sensor(
        scalar_field("racket_position", Kind::float64, "of the racket's centre [m]", 3));
    at.racket_velocity.offset =
        schema.add_sensor(scalar_field("racket_velocity", Kind::float64, "likewise [m/s]", 3));
  }
  if (!imposed && !model.joints.empty()) {
    const std::uint32_t type = describing::type_of<JointState>(schema);
    at.seen_joints = places<JointState>(
        schema.add_sensor(structure("joints", type, model.joints.size(), "in the model's order")),
        model.joints.size());
  }
  if (!model.driven) {
    at.engine_contacts.offset = schema.add_sensor(
        scalar_field("engine_contacts", Kind::uint32, "between bodies, as the engine sees them"));
  }
  for (const SensorPlace& sensor : model.sensors) {
    const auto rows = static_cast<std::uint32_t>(sensor.numbers == 1 ? 0 : sensor.numbers);
    at.sensors.push_back(
        {schema.add_sensor(scalar_field(sensor.name, Kind::float64, "sensor of the model", rows))});
  }
  return at;
}

// the iteration lasts a whole number of steps, as many as were asked for
void MujocoDriver::describe(Schema& schema) const {
  (void)add_to(schema);
  const std::int64_t asked = schema.asked_period();
  const double step = simulation_.timestep() * 1e9;
  const std::uint32_t steps = asked == 0 ? std::max(1U, steps_) : steps_in(asked);
  schema.period(std::llround(steps * step));
}

std::uint32_t MujocoDriver::steps_in(std::int64_t period) const {
  const double step = simulation_.timestep() * 1e9;
  const auto asked = static_cast<double>(period);
  const double steps = steps_ > 0 ? steps_ : std::max(1.0, std::round(asked / step));
  if (std::abs(steps * step - asked) <= kPeriodTolerance * asked)
    return static_cast<std::uint32_t>(steps);

  char text[400];
  if (steps_ > 0) {
    std::snprintf(text, sizeof text,
                  "%u steps of %g ms make iterations of %g ms, not of %g ms (%g Hz). Ask for "
                  "%g Hz, or leave out either the frequency or steps",
                  steps_, step * 1e-6, steps * step * 1e-6, asked * 1e-6, 1e9 / asked,
                  1e9 / (steps * step));
  } else {
    const double fewer = std::floor(asked / step);
    const double more = fewer + 1;
    char slower[40] = "";
    if (fewer > 0) std::snprintf(slower, sizeof slower, " or %g", 1e9 / (more * step));
    std::snprintf(
        text, sizeof text,
        "%g Hz (iterations of %g ms) is not a whole number of the model's steps of %g ms. "
        "Ask for %g%s Hz, leave the frequency out (%g Hz), or give timestep=%.9g [s]",
        1e9 / asked, asked * 1e-6, step * 1e-6, 1e9 / (std::max(1.0, fewer) * step), slower,
        1e9 / step, asked / more * 1e-9);
  }
  throw DriverError(text);
}

// desired => targets => one iteration
void MujocoDriver::write(const Desired<MujocoDriver>& desired) {
  if (!steps_known_) {
    simulation_.steps(steps_in(std::llround(desired.period() * 1e9)));
    steps_known_ = true;
  }
  Targets& targets = simulation_.targets();
  for (std::size_t i = 0; i < places_.joints.size(); ++i) {
    targets.joints[i] = desired.at(places_.joints[i]);
  }
  for (std::size_t i = 0; i < places_.controls.size(); ++i) {
    targets.controls[i] = desired.at(places_.controls[i]);
  }
  for (std::size_t i = 0; i < places_.balls.size(); ++i) {
    targets.balls[i] = {desired.at(places_.balls[i]), desired.active(places_.first_ball + i)};
  }
  simulation_.advance();
}

void MujocoDriver::read(Reading<MujocoDriver>& reading) {
  for (std::size_t i = 0; i < places_.joints.size(); ++i) {
    reading.observe(places_.joints[i], simulation_.joint(i));
  }
  for (std::size_t i = 0; i < places_.controls.size(); ++i) {
    reading.observe(places_.controls[i], simulation_.control(i));
  }
  for (std::size_t i = 0; i < places_.balls.size(); ++i) {
    reading.observe(places_.balls[i], simulation_.ball(i));
    reading.extend(places_.records[i], simulation_.record(i));
    if (simulation_.released(i) && !reading.fresh()) reading.interrupt(places_.first_ball + i);
  }
  reading.extend(places_.clock, simulation_.clock());
  for (std::size_t i = 0; i < places_.seen_joints.size(); ++i) {
    reading.extend(places_.seen_joints[i], simulation_.joint(i));
  }
  if (const Pose* racket = simulation_.racket(); racket != nullptr) {
    reading.extend(places_.racket_position, numbers(racket->position));
    reading.extend(places_.racket_velocity, numbers(racket->velocity));
  }
  if (!simulation_.model().driven) {
    reading.extend(places_.engine_contacts, simulation_.engine_contacts());
  }
  for (std::size_t i = 0; i < places_.sensors.size(); ++i) {
    Number at = places_.sensors[i];
    for (const double number : simulation_.sensor(i)) {
      reading.extend(at, number);
      at.offset += sizeof(double);
    }
  }
  if (reading.fresh()) go_on_from_targets(reading);
  if (simulation_.diverged()) {
    reading.fault(
        "the simulation diverged: a position, velocity or acceleration is no number or too large. "
        "Give it a smaller timestep and more steps, or gentler commands");
  }
}

/// After a reset or a restore: what was asked last in the state that came back.
void MujocoDriver::go_on_from_targets(Reading<MujocoDriver>& reading) {
  const Targets& targets = simulation_.targets();
  std::byte* desired = reading.desired_bytes();
  for (std::size_t i = 0; i < places_.joints.size(); ++i) {
    pack(targets.joints[i], desired + places_.joints[i].offset);
  }
  for (std::size_t i = 0; i < places_.controls.size(); ++i) {
    pack(targets.controls[i], desired + places_.controls[i].offset);
  }
  for (std::size_t i = 0; i < places_.balls.size(); ++i) {
    pack(targets.balls[i].state, desired + places_.balls[i].offset);
  }
}

Served MujocoDriver::on(const Reset&) noexcept {
  simulation_.reset();  // nothing is drawn by chance: any seed gives the same start
  return Served::start_afresh();
}

Served MujocoDriver::on(const Snapshot& snapshot) noexcept {
  return simulation_.snapshot(snapshot.slot) ? Served::done() : no_such_slot();
}

Served MujocoDriver::on(const Restore& restore) noexcept {
  if (restore.slot >= simulation_.slots()) return no_such_slot();
  if (simulation_.restore(restore.slot)) return Served::start_afresh();
  return Served::rejected("nothing was kept in this slot: snapshot it first");
}

Served MujocoDriver::on(const ClearContacts& which) noexcept {
  const std::size_t balls = simulation_.model().balls.size();
  if (which.ball > balls) {
    char text[160];
    std::snprintf(text, sizeof text, "there are %zu balls, counted from 1; 0 means all of them",
                  balls);
    return Served::rejected(text);
  }
  for (std::size_t i = 0; i < balls; ++i) {
    if (which.ball == 0 || which.ball == i + 1) simulation_.clear(i);
  }
  return Served::done();
}

Served MujocoDriver::no_such_slot() const noexcept {
  char text[160];
  std::snprintf(text, sizeof text,
                "there are %zu slots, counted from 0; start the simulator with more (slots=...)",
                simulation_.slots());
  return Served::rejected(text);
}

}  // namespace o80::mujoco
