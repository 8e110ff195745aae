#include "driver/driver.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <utility>

#include "driver/steps_in_period.hpp"

namespace o80::mujoco {
namespace {

/// Type of the states of spread joints, in the numbers of their actuators.
std::uint32_t type_of_spread(Schema& schema, const std::vector<JointPlace>& joints) {
  const TypeRow own = schema.types[describing::type_of<JointState>(schema)];
  const auto first = schema.fields.begin() + own.first_field;
  std::vector<FieldRow> fields(first, first + own.fields);
  std::string units;
  std::string rates;
  const auto add = [&](const char* unit, const char* rate, auto&& has) {
    if (std::ranges::none_of(joints, has)) return;
    units += (units.empty() ? "" : " or ") + std::string(unit);
    rates += (rates.empty() ? "" : " or ") + std::string(rate);
  };
  add("rad", "rad/s", [](const JointPlace& each) { return !each.spread && !each.slides; });
  add("m", "m/s", [](const JointPlace& each) { return !each.spread && each.slides; });
  add("1", "1/s", [](const JointPlace& each) { return each.spread; });
  fields[0].unit = UnitText(units);
  fields[1].unit = UnitText(rates);
  return schema.add_type("ActuatorState", fields);
}

/// Type of the states of joints, with the unit "rad or m" only for both kinds.
std::uint32_t type_of_states(Schema& schema, const std::vector<JointPlace>& joints) {
  const std::uint32_t type = describing::type_of<JointState>(schema);
  const auto slides = std::ranges::count(joints, true, &JointPlace::slides);
  if (slides != 0 && slides != std::ssize(joints)) return type;
  FieldRow* fields = schema.fields.data() + schema.types[type].first_field;
  fields[0].unit = UnitText(slides != 0 ? "m" : "rad");
  fields[1].unit = UnitText(slides != 0 ? "m/s" : "rad/s");
  return type;
}

/// Adds an array of actuators with the names of model elements; returns the place of each.
template <class T, class Member>
std::vector<Place<T>> add_group(Schema& schema, std::string_view group, std::uint32_t type,
                                const std::vector<Member>& members) {
  const auto first = static_cast<std::uint32_t>(schema.actuators.size());
  const auto count = static_cast<std::uint32_t>(members.size());
  schema.add_actuators(group, type, count);
  std::vector<Place<T>> places(count);
  for (std::uint32_t i = 0; i < count; ++i) {
    schema.actuator(first + i).name(members[i].name).when_idle(WhenIdle::hold);
    places[i].offset = schema.actuators[first + i].offset;
  }
  return places;
}

/// Adds the states of joints as a sensor value; returns the place of each.
std::vector<Place<JointState>> add_joint_sensors(Schema& schema,
                                                 const std::vector<JointPlace>& joints) {
  const std::size_t count = joints.size();
  FieldRow field = scalar_field("joints", Kind::structure, "in the model's order",
                                static_cast<std::uint32_t>(count));
  field.type = type_of_states(schema, joints);
  const std::uint32_t first = schema.add_sensor(field);
  std::vector<Place<JointState>> places(count);
  for (std::size_t i = 0; i < count; ++i) {
    places[i].offset = first + static_cast<std::uint32_t>(i * sizeof(JointState));
  }
  return places;
}

/// Adds the actuators of driven joints, at the begin of the states.
void add_face(const JointFace& face, Schema& schema) {
  const Schema& own = face.schema;
  for (const GroupRow& group : own.groups) {
    const TypeRow& type = own.types[group.type];
    const auto first = own.fields.begin() + type.first_field;
    const std::uint32_t added = schema.add_type(type.name.view(), {first, first + type.fields});
    schema.add_actuators(group.name.view(), added, group.count);
  }
  for (std::uint32_t i = 0; i < own.actuators.size(); ++i) {
    schema.actuator(i).name(own.actuators[i].name.view());
  }
  schema.limits = own.limits;
  schema.integrals = own.integrals;
}

/// Adds the requests specific to these simulations.
struct BallRequests {
  using Actuators = RunTimeActuators;
  using Requests = o80::Requests<ClearContacts, FlyOut>;
};

}  // namespace

MujocoDriver::MujocoDriver(const Config& config)
    : simulation_(config), steps_(config.steps), is_like_(!config.like.empty()) {
  Schema schema;
  places_ = add_to(schema);
  commanded_.reserve(schema.actuators.size());
}

MujocoDriver::Places MujocoDriver::add_to(Schema& schema) const {
  Places places;
  if (is_like_) {
    take_face(schema);
  } else {
    describe_types<BallRequests>(schema);
    add_place(schema, simulation_.free_bodies());
    add_actuators(schema, places);
    add_sensors(schema, places);
  }
  show(schema, places);
  return places;
}

/// Copies the other robot's description but its name, with the simulation's requests first.
void MujocoDriver::take_face(Schema& schema) const {
  Schema own = face()->schema;
  const std::vector<RequestRow> others = std::exchange(own.requests, {});
  describe_types<MujocoDriver>(own);
  own.requests.insert(own.requests.end(), others.begin(), others.end());
  own.head.robot = schema.head.robot;
  if (schema.head.period != 0) own.head.period = schema.head.period;
  schema = std::move(own);
}

/// Describes the model for viewers, and the values that move joints and balls.
void MujocoDriver::show(Schema& schema, const Places& places) const {
  const Model& model = simulation_.model();
  schema.shown.mjcf = model.mjcf;
  schema.shown.file = model.file;
  for (std::size_t i = 0; i < places.joints.size(); ++i) {
    const JointPlace& joint = model.joints[i];
    if (!joint.spread) schema.shown.joint(joint.joint, places.joints[i].offset);
  }
  for (std::size_t i = 0; i < places.joint_sensors.size(); ++i) {
    if (face() && face()->moves(model.joints[i].position)) continue;
    if (model.imposed && !model.joints[i].spread) continue;
    schema.shown.joint(model.joints[i].joint, places.joint_sensors[i].offset, ShownFrom::extended);
  }
  if (face()) face()->show(*model.model, schema.shown);
  if (const Balls* balls = simulation_.balls()) places.balls.show(schema.shown, *balls);
}

void MujocoDriver::add_actuators(Schema& schema, Places& places) const {
  const Model& model = simulation_.model();
  if (face()) add_face(*face(), schema);
  if (model.imposed && !model.joints.empty()) {
    const std::uint32_t type =
        model.spreads ? type_of_spread(schema, model.joints) : type_of_states(schema, model.joints);
    places.joints = add_group<JointState>(schema, "joints", type, model.joints);
  }
  const auto first_control = static_cast<std::uint32_t>(schema.actuators.size());
  if (!model.controls.empty()) {
    places.controls =
        add_group<double>(schema, "controls", describing::type_of<double>(schema), model.controls);
  }
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
  if ((!model.imposed || model.spreads) && !model.joints.empty()) {
    places.joint_sensors = add_joint_sensors(schema, model.joints);
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
  places.bodies = add_body_sensors(schema, simulation_.free_bodies());
}

void MujocoDriver::describe(Schema& schema) const {
  const std::int64_t requested = schema.asked_period();
  (void)add_to(schema);
  schema.simulated();
  if (is_like_) {  // any rate, like the other robot
    constexpr std::int64_t kDefault = 1'000'000;
    if (schema.head.period == 0) schema.period(kDefault);
    period_ = schema.head.period;
    return;
  }
  const double timestep = simulation_.timestep();
  if (simulation_.model().imposed && requested != 0 &&
      !is_whole_steps(requested, timestep, steps_)) {
    period_ = requested;
    return;
  }
  const std::uint32_t steps =
      requested == 0 ? std::max(1U, steps_) : steps_in_period(requested, timestep, steps_);
  schema.period(std::llround(steps * (timestep * 1e9)));
}

/// A simulation that follows another robot has any period, divided into engine steps that are
/// at most as long as the model's.
void MujocoDriver::start() {
  if (period_ == 0) return;
  const double period = static_cast<double>(period_) * 1e-9;
  const double most = std::ceil(period / simulation_.timestep() * (1 - kPeriodTolerance));
  simulation_.steps(steps_ > 0 ? steps_ : static_cast<std::uint32_t>(std::max(1.0, most)), period);
  steps_known_ = true;
}

// desired => targets => one iteration
void MujocoDriver::write(const Desired<MujocoDriver>& desired) {
  if (!steps_known_) {
    simulation_.steps(
        steps_in_period(std::llround(desired.period() * 1e9), simulation_.timestep(), steps_));
    steps_known_ = true;
  }
  commanded_.clear();
  const std::size_t relaxed = simulation_.relaxed() ? face()->schema.actuators.size() : 0;
  for (std::uint32_t i = 0; i < relaxed; ++i) {
    if (desired.active(i)) commanded_.push_back(i);
  }
  Targets& targets = simulation_.targets();
  targets.commanded = false;
  for (std::size_t i = 0; i < places_.joints.size(); ++i) {
    targets.joints[i] = desired.at(places_.joints[i]);
    targets.commanded = targets.commanded || desired.active(i);
  }
  for (std::size_t i = 0; i < places_.controls.size(); ++i) {
    targets.controls[i] = desired.at(places_.controls[i]);
  }
  std::copy_n(desired.bytes(), targets.states.size(), targets.states.begin());
  if (Balls* balls = simulation_.balls()) places_.balls.write(desired, *balls);
  simulation_.advance();
}

void MujocoDriver::read(Reading<MujocoDriver>& reading) {
  for (std::size_t i = 0; i < places_.joints.size(); ++i) {
    reading.observe(places_.joints[i], simulation_.imposed(i));
  }
  for (std::size_t i = 0; i < places_.controls.size(); ++i) {
    reading.observe(places_.controls[i], simulation_.control(i));
  }
  if (face()) {
    const std::vector<std::byte>& states = simulation_.targets().states;
    std::ranges::copy(states, reading.observed_bytes());
    face()->observe(simulation_.data(), reading.observed_bytes());
  }
  if (const Balls* balls = simulation_.balls()) places_.balls.read(*balls, reading);
  if (is_like_) {
    face()->extend(simulation_.data(), reading.time(), reading.extended_bytes());
  } else {
    read_sensors(reading);
  }
  if (reading.fresh()) go_on_from_targets(reading);
  if (reading.fresh() && simulation_.relaxed()) reading.follow();
  for (const std::uint32_t actuator : commanded_)
    reading.interrupt(actuator);  // nothing would move
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
  for (const BodyRow& row : places_.bodies) {
    reading.extend(row.place, state_of(simulation_.free_bodies()[row.body], simulation_.data()));
  }
}

/// After a reset or a restore the desired states are the last targets of the restored state.
void MujocoDriver::go_on_from_targets(Reading<MujocoDriver>& reading) {
  const Targets& targets = simulation_.targets();
  std::byte* desired = reading.desired_bytes();
  // driven joints continue from their positions, as on a robot; a restore is exact
  const std::byte* states =
      std::exchange(restored_, false) ? targets.states.data() : reading.observed_bytes();
  std::copy_n(states, targets.states.size(), desired);
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
  if (simulation_.restore(restore.slot)) {
    restored_ = true;
    return Served::start_afresh();
  }
  return Served::rejected("this slot has no snapshot: send the request snapshot first");
}

/// Serves the requests of arms that the model supports.
Served MujocoDriver::serve_as_arm(JointFace::Word word, const std::byte* payload) noexcept {
  using Word = JointFace::Word;
  if (word == Word::none) {
    return Served::rejected(
        "this simulation only describes the request; the robot itself serves it");
  }
  if (word == Word::strength) {
    const auto share = unpack<double>(payload);
    if (!(share > 0 && share <= 1)) {
      return Served::rejected("the share must be above 0 and at most 1");
    }
    simulation_.strength(share);
    return Served::done();
  }
  if (word != Word::recover) simulation_.relax(word == Word::relax);
  return Served::start_afresh();
}

/// Makes the joints hold again, as on an arm.
Served MujocoDriver::resume() noexcept {
  simulation_.relax(false);
  return Served::done();
}

/// Serves requests of balls and free bodies, or of the other robot.
Served MujocoDriver::on(std::uint32_t request, const std::byte* payload) noexcept {
  if (is_like_) return serve_as_arm(face()->words[request - 3], payload);
  if (request == 5) return simulation_.place(unpack<PlaceBody>(payload));
  return request == 3 ? clear_contacts(simulation_.balls(), unpack<ClearContacts>(payload))
                      : fly_out(simulation_.balls(), unpack<FlyOut>(payload));
}

Served MujocoDriver::no_such_slot() const noexcept {
  char text[160];
  std::snprintf(text, sizeof text,
                "there are %zu slots, counted from 0; start the simulator with more (slots=...)",
                simulation_.slots());
  return Served::rejected(text);
}

}  // namespace o80::mujoco
