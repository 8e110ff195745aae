#include "driver/joint_face.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <limits>
#include <map>
#include <string>
#include <string_view>
#include <utility>

#include "engine/names.hpp"
#include "engine/urdf_speeds.hpp"
#include "o80/base/error.hpp"

namespace o80::mujoco {
namespace {

using Input = JointFace::Input;
using Number = JointFace::Number;
using Word = JointFace::Word;

Quantity quantity_of_name(std::string_view name) {
  if (name == "position") return Quantity::position;
  if (name == "velocity") return Quantity::velocity;
  return name == "torque" || name == "force" || name == "effort" ? Quantity::effort
                                                                 : Quantity::none;
}

Quantity quantity_of_unit(std::string_view unit) {
  if (unit == "rad" || unit == "m") return Quantity::position;
  if (unit == "rad/s" || unit == "m/s") return Quantity::velocity;
  return unit == "Nm" || unit == "N" || unit == "N m" ? Quantity::effort : Quantity::none;
}

/// Kind of a state's number: by its unit, else by its name; a plain number is a position.
Quantity quantity_of(const FieldRow& field) {
  const Quantity by_unit = quantity_of_unit(field.unit.view());
  const Quantity by_name = quantity_of_name(field.name.view());
  if (field.kind != Kind::float64) return Quantity::none;
  if (by_unit != Quantity::none) return by_unit;
  if (field.name.view().empty()) return Quantity::position;
  return by_name == Quantity::position || field.unit.view().empty() ? by_name : Quantity::none;
}

const char* word(Quantity quantity) {
  constexpr std::array<const char*, 3> kWords{"position", "velocity", "torque or force"};
  return kWords.at(static_cast<std::size_t>(quantity));
}

std::string shown(double number) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%g", number);
  return text.data();
}

/// Converts an interval by the inverse of `line`.
Range back(const Line& line, const Range& range) {
  Range found{line.back(range.low), line.back(range.high)};
  if (line.factor < 0) std::swap(found.low, found.high);
  return found;
}

template <class Rows, class Value, class Part>
bool has(const Rows& rows, const Value& value, Part part) {
  return std::ranges::find(rows, value, part) != rows.end();
}

constexpr std::array kQuantities{Quantity::position, Quantity::velocity, Quantity::effort};

class Builder {
 public:
  Builder(const mjModel& model, const Config& config)
      : model_(model),
        is_like_(!config.like.empty()),
        named_(named_in(config.joints)),
        servos_(servos_in(model)) {
    if (is_like_) {
      take(config.like);
    } else {
      describe(urdf_speeds(config.model), config.limits);
    }
    for (std::uint32_t i = 0; i < schema().actuators.size(); ++i) drive(i);
    for (RequestRow& request : schema().requests) {
      face.words.push_back(word_of(request));
      if (face.words.back() == Word::none) request.help = HelpText(kAbsent);
    }
    if (is_like_ && schema().head.extended != kNoType) {
      face.absent.resize(schema().types[schema().head.extended].size);
      serve(schema().head.extended, 0, kNoType);
    }
  }

  JointFace face;

 private:
  Schema& schema() { return face.schema; }
  bool is_slide(int joint) const { return model_.jnt_type[joint] == mjJNT_SLIDE; }
  const Servo* servo_of(int joint, Quantity quantity) const {
    for (const Servo& servo : servos_) {
      if (servo.joint == joint && servo.commanded == quantity) return &servo;
    }
    return nullptr;
  }

  // the face of the model

  /// speeds: limits by the names of joints.
  void describe(const std::map<std::string, double>& speeds, const std::string& limits) {
    if (named_.empty()) {
      for (const Servo& servo : servos_) {
        const std::string name = name_of(model_, mjOBJ_JOINT, servo.joint, "joint");
        if (!has(named_, name, &Named::name)) named_.push_back({name, name, {}});
      }
    }
    if (named_.empty()) {
      throw DriverError(
          "the model has no actuator that drives a hinge or a slide: add one "
          "(<position joint=.../>), or give mode=imposed");
    }
    for (const Named& named : named_) {
      if (!has(servos_, joint_of(named), &Servo::joint)) refuse_without_actuator(named);
      if (!named.over.empty()) {
        throw DriverError("joints: '" + named.name + "' has numbers, which need the option like");
      }
    }
    for (const Quantity quantity : kQuantities) {
      for (const bool slides : {false, true}) add_group(quantity, slides);
    }
    for (const auto& [joint, speed] : speeds) limit_speed(joint, speed);
    limit(limits);
  }

  [[noreturn]] static void refuse_without_actuator(const Named& named) {
    throw DriverError("joint '" + named.joint + "' has no actuator: add one to the model");
  }

  /// Finds the joint of this name, or the joint of the actuator of this name.
  int joint_of(const Named& named) const {
    for (const mjtObj kind : {mjOBJ_JOINT, mjOBJ_ACTUATOR}) {
      for (const Servo& servo : servos_) {
        const int id = kind == mjOBJ_JOINT ? servo.joint : servo.actuator;
        if (name_of(model_, kind, id, "joint") == named.joint) return servo.joint;
      }
    }
    return find(model_, mjOBJ_JOINT, named.joint, "joint");
  }

  /// Chooses the command of a joint: position before velocity, velocity before torque.
  Quantity commanded(int joint) const {
    return *std::ranges::find_if(kQuantities,
                                 [&](Quantity each) { return servo_of(joint, each) != nullptr; });
  }

  void add_group(Quantity quantity, bool slides) {
    constexpr const char* kGroups[][2] = {{"joints", "slides"},
                                          {"velocity_joints", "velocity_slides"},
                                          {"torque_joints", "force_slides"}};
    std::vector<std::string> names;
    for (const Named& named : named_) {
      const int joint = joint_of(named);
      if (commanded(joint) == quantity && is_slide(joint) == slides) names.push_back(named.name);
    }
    if (names.empty()) return;
    constexpr const char* kUnits[][2] = {{"[rad]", "[m]"}, {"[rad/s]", "[m/s]"}, {"[Nm]", "[N]"}};
    const std::array words{"", "velocity", slides ? "force" : "torque"};
    const auto number = [&](Quantity of, const char* name) {
      return scalar_field(name, Kind::float64, kUnits[static_cast<int>(of)][slides ? 1 : 0]);
    };
    const auto kind = static_cast<std::size_t>(quantity);
    std::vector<FieldRow> fields{number(quantity, words.at(kind))};
    if (quantity != Quantity::position) {
      fields.front().resting = 1;
      fields.push_back(number(Quantity::position, "position"));
    }
    const auto first = static_cast<std::uint32_t>(schema().actuators.size());
    const char* group = kGroups[kind][slides ? 1 : 0];
    const std::uint32_t type = schema().add_type(words.at(kind), fields);
    schema().add_actuators(group, type, static_cast<std::uint32_t>(names.size()));
    for (std::uint32_t i = 0; i < names.size(); ++i) schema().actuator(first + i).name(names[i]);
  }

  /// Limits of positions, and of commanded velocities.
  void limit_speed(const std::string& joint, double speed) {
    const int id = mj_name2id(&model_, mjOBJ_JOINT, joint.c_str());
    for (Servo& servo : servos_) {
      if (servo.joint != id || servo.commanded != Quantity::velocity) continue;
      servo.allowed = intersection(servo.allowed, {-speed, speed});
    }
    for (const Named& named : named_) {
      if (joint_of(named) != id || commanded(id) != Quantity::position) continue;
      schema().actuator(named.name).limits({.speed = speed});
    }
  }

  /// Parses "2.5 20 1000 0.35, elbow=2": for all joints, then for one.
  void limit(const std::string& list) {
    for (const std::string& entry : entries_of(list)) {
      const auto equals = entry.find('=');
      const std::string name = equals == std::string::npos ? "" : trimmed(entry.substr(0, equals));
      const auto numbers =
          numbers_of(std::string_view(entry).substr(equals == std::string::npos ? 0 : equals + 1));
      if (!numbers || numbers->empty() || numbers->size() > 4) {
        throw DriverError("limits: '" + entry +
                          "' must have one to four numbers: speed, "
                          "acceleration, jerk and error");
      }
      if (!name.empty()) (void)schema().actuator(name);  // throws with the names
      for (const ActuatorRow& actuator : schema().actuators) {
        if (!name.empty() && actuator.name.view() != name) continue;
        LimitRow& row = schema().limits[actuator.first_limit];
        double* const places[] = {&row.speed, &row.acceleration, &row.jerk, &row.error};
        for (std::size_t i = 0; i < numbers->size(); ++i) *places[i] = (*numbers)[i];
      }
    }
  }

  // the face of another robot

  void take(const Face& other) {
    schema() = other.schema;
    if (schema().actuators.empty()) throw DriverError("like: the other robot has no actuators");
    for (const Named& named : named_) (void)schema().actuator(named.name);  // throws with the names
    std::erase_if(schema().requests, [](const RequestRow& request) {
      const std::string_view name = request.name.view();
      return name == "reset" || name == "snapshot" || name == "restore";
    });
    for (FieldRow& field : schema().fields) {
      if (field.origin != Origin::clock) field.origin = Origin::robot;  // a simulation repeats
    }
  }

  /// A force can be removed only if it follows from the input at once.
  Word word_of(const RequestRow& request) const {
    const std::string_view name = request.name.view();
    if (!std::ranges::all_of(face.inputs, [&](const Input& input) {
          return model_.actuator_dyntype[input.actuator] == mjDYN_NONE;
        })) {
      return Word::none;
    }
    if (request.type == kNoType || face.schema.types[request.type].fields == 0) {
      return name == "hold"      ? Word::hold
             : name == "relax"   ? Word::relax
             : name == "recover" ? Word::recover
                                 : Word::none;
    }
    const TypeRow& type = face.schema.types[request.type];
    const FieldRow& first = face.schema.fields[type.first_field];
    const bool is_one_number = type.fields == 1 && first.rows == 0 && first.kind == Kind::float64;
    const bool have_most = std::ranges::all_of(face.inputs, [&](const Input& input) {
      return !input.weakens || model_.actuator_forcelimited[input.actuator] != 0;
    });
    return name == "strength" && is_one_number && have_most ? Word::strength : Word::none;
  }

  // from numbers of an actuator to numbers of its joint

  void drive(std::uint32_t index) {
    const ActuatorRow& actuator = schema().actuators[index];
    const auto entry = std::ranges::find(named_, actuator.name.view(), &Named::name);
    const Named named =
        entry != named_.end() ? *entry : Named{actuator.name.str(), actuator.name.str(), {}};
    const int joint = joint_of(named);
    joints_.push_back(joint);
    const Servo& servo = servo_for(actuator, named, joint);
    const Line line = spread(actuator, named, servo);
    std::uint32_t limit = actuator.first_limit;
    bool driven = false;
    schema().each_scalar(
        actuator.type,
        [&](std::uint32_t offset, const FieldRow& field) {
          LimitRow& row = schema().limits[limit++];
          const Quantity quantity = quantity_of(field);
          if (quantity == Quantity::none) return;
          const Line own = quantity == Quantity::position   ? line
                           : quantity == Quantity::velocity ? Line{line.factor, 0}
                                                            : Line{};
          add_number(face.states, offset, quantity, joint, own);
          if (quantity != servo.commanded || std::exchange(driven, true)) return;
          add_input(offset, servo, own);
          bound(actuator, named, row, back(own, servo.allowed));
        },
        actuator.offset);
    // a velocity brakes before the joint's range ends
    const bool moves = servo.commanded == Quantity::velocity && std::isfinite(servo.positions.low);
    if (!is_like_ && moves) {
      schema().integrals.push_back(
          {actuator.first_limit, 1, servo.positions.low, servo.positions.high, 0.0});
    }
  }

  void add_number(std::vector<Number>& to, std::uint32_t offset, Quantity quantity, int joint,
                  const Line& line) const {
    const int address =
        quantity == Quantity::position ? model_.jnt_qposadr[joint] : model_.jnt_dofadr[joint];
    to.push_back({offset, quantity, joint, address, line});
  }

  void add_input(std::uint32_t offset, const Servo& servo, const Line& own) {
    const Line line{servo.input.factor * own.factor, servo.input.of(own.shift)};
    const bool holds = servo.commanded == Quantity::position;
    face.inputs.push_back({offset, line, servo.control,
                           holds ? model_.jnt_qposadr[servo.joint] : -1, servo.input,
                           servo.actuator, own.factor == 1});
  }

  const Servo& servo_for(const ActuatorRow& actuator, const Named& named, int joint) const {
    std::string takes_what;
    for (const Quantity each : kQuantities) {
      const Servo* servo = servo_of(joint, each);
      if (servo == nullptr) continue;
      bool takes = false;
      face.schema.each_scalar(actuator.type, [&](std::uint32_t, const FieldRow& field) {
        takes = takes || quantity_of(field) == each;
      });
      if (takes) return *servo;
      takes_what += (takes_what.empty() ? "" : " or ") + std::string(word(each));
    }
    if (takes_what.empty()) refuse_without_actuator(named);
    throw DriverError("the actuator of joint '" + named.joint + "' takes its " + takes_what +
                      ", which the state of '" + named.name + "' does not have");
  }

  /// Conversion of an actuator's position to its joint's: equal, or spread over the range.
  Line spread(const ActuatorRow& actuator, const Named& named, const Servo& servo) const {
    std::vector<double> over = named.over;
    std::uint32_t limit = actuator.first_limit;
    std::string unit;
    face.schema.each_scalar(actuator.type, [&](std::uint32_t, const FieldRow& field) {
      const LimitRow& row = face.schema.limits[limit++];
      if (quantity_of(field) != Quantity::position || !unit.empty()) return;
      unit = field.unit.str();
      const bool is_share = unit == "1" && std::isfinite(row.minimum) && std::isfinite(row.maximum);
      if (over.empty() && is_share && row.minimum < row.maximum) over = {row.minimum, row.maximum};
    });
    const std::string own = is_slide(servo.joint) ? "m" : "rad";
    if (over.empty() && !unit.empty() && unit != own) {
      throw DriverError("'" + named.name + "' is in " + unit + ", joint '" + named.joint + "' in " +
                        own + ": give its values at the ends of the joint's range, like joints=`" +
                        named.name + "=" + named.joint + " 0 1`");
    }
    if (over.empty()) return {};
    const Range range = servo.commanded == Quantity::position ? servo.allowed : servo.positions;
    return spread_over(named, over, range);
  }

  /// Sets missing bounds to the model's, and checks that given ones are inside these.
  void bound(const ActuatorRow& actuator, const Named& named, LimitRow& row, const Range& allowed) {
    constexpr double kTolerance = 1e-4;  // tolerance of rounded numbers, as a share of the width
    const double slack = kTolerance * (allowed.high - allowed.low);
    const bool fits = (!std::isfinite(row.minimum) || row.minimum >= allowed.low - slack) &&
                      (!std::isfinite(row.maximum) || row.maximum <= allowed.high + slack);
    if (!fits) {
      throw DriverError("'" + actuator.name.str() + "' is allowed from " + shown(row.minimum) +
                        " to " + shown(row.maximum) + ", but joint '" + named.joint +
                        "' of the model only from " + shown(allowed.low) + " to " +
                        shown(allowed.high) + ": widen its range and ctrlrange in the model");
    }
    if (!std::isfinite(row.minimum)) row.minimum = allowed.low;
    if (!std::isfinite(row.maximum)) row.maximum = allowed.high;
  }

  // sensor values of the face

  /// element: index in an array with an element for each actuator, or kNoType.
  void serve(std::uint32_t type, std::uint32_t base, std::uint32_t element) {
    const TypeRow row = schema().types[type];
    for (std::uint32_t i = row.first_field; i < row.first_field + row.fields; ++i) {
      FieldRow& field = schema().fields[i];
      const bool for_each = field.count() == joints_.size();
      bool served = type == schema().head.extended && serve_sensor(field);
      for (std::uint32_t e = 0; !served && e < field.count(); ++e) {
        const std::uint32_t offset = base + field.offset + e * field.size;
        if (field.kind == Kind::structure) {
          serve(field.type, offset, for_each ? e : element);
        } else if (!serve_number(field, offset, for_each ? e : element) &&
                   !has(schema().groups, type, &GroupRow::type)) {
          field.origin = Origin::absent;
          field.help = FieldHelpText(kAbsent);
        }
      }
    }
  }

  bool serve_sensor(const FieldRow& field) {
    const int id = mj_name2id(&model_, mjOBJ_SENSOR, field.name.str().c_str());
    if (id < 0 || field.kind != Kind::float64) return false;
    if (model_.sensor_dim[id] != static_cast<int>(field.count())) return false;
    for (std::uint32_t i = 0; i < field.count(); ++i) {
      face.sensors.push_back({field.offset + 8 * i,
                              Quantity::none,
                              -1,
                              model_.sensor_adr[id] + static_cast<int>(i),
                              {}});
    }
    return true;
  }

  /// Sensor values of arms: velocity or torque of a joint, time, freshness of a reading.
  bool serve_number(FieldRow& field, std::uint32_t offset, std::uint32_t element) {
    const Quantity quantity = quantity_of_name(field.name.view());
    const std::string_view name = field.name.view();
    if (field.kind == Kind::float64 && element < joints_.size() && quantity != Quantity::none &&
        quantity == quantity_of_unit(field.unit.view())) {
      add_number(face.sensors, offset, quantity, joints_[element], {});
      return true;
    }
    if (name == "capture_time" && field.kind == Kind::int64) {
      face.capture_times.push_back(offset);
      field.origin = Origin::clock;
      return true;
    }
    if (name == "fresh" && field.kind == Kind::boolean) {
      face.absent[offset] = std::byte{1};
      return true;
    }
    const auto nan = [&]<class T>(T) {
      constexpr T kNaN = std::numeric_limits<T>::quiet_NaN();
      std::memcpy(face.absent.data() + offset, &kNaN, sizeof kNaN);
    };
    if (field.kind == Kind::float64) nan(double{});
    if (field.kind == Kind::float32) nan(float{});
    return false;
  }

  static constexpr std::string_view kAbsent = "absent: the model does not have it";

  const mjModel& model_;
  bool is_like_;
  std::vector<Named> named_;
  std::vector<Servo> servos_;
  std::vector<int> joints_;  // of the actuators
};

double value(const mjData& data, const Number& number) noexcept {
  switch (number.quantity) {
    case Quantity::position:
      return data.qpos[number.address];
    case Quantity::velocity:
      return data.qvel[number.address];
    case Quantity::effort:
      return data.qfrc_actuator[number.address];
    default:
      return data.sensordata[number.address];
  }
}

void put(const mjData& data, const std::vector<Number>& numbers, std::byte* block) noexcept {
  for (const Number& number : numbers) {
    const double found = number.line.back(value(data, number));
    std::memcpy(block + number.offset, &found, sizeof found);
  }
}

}  // namespace

std::vector<Named> named_in(const std::string& list) {
  std::vector<Named> all;
  for (const std::string& entry : entries_of(list)) {
    const auto equals = entry.find('=');
    Named named;
    named.name = trimmed(entry.substr(0, equals));
    named.joint = equals == std::string::npos ? named.name : trimmed(entry.substr(equals + 1));
    const auto space = named.joint.find(' ');
    if (equals != std::string::npos && space != std::string::npos) {
      const auto numbers = numbers_of(std::string_view(named.joint).substr(space));
      if (!numbers || numbers->size() != 2 || (*numbers)[0] == (*numbers)[1]) {
        throw DriverError("joints: '" + entry +
                          "' must be like `jaw=j6`, or `jaw=j6 0 1` with the "
                          "two numbers at the ends of the joint's range");
      }
      named.over = *numbers;
      named.joint.resize(space);
    }
    all.push_back(named);
  }
  return all;
}

Line spread_over(const Named& named, const std::vector<double>& over, const Range& range) {
  if (!std::isfinite(range.low) || !std::isfinite(range.high)) {
    throw DriverError("joint '" + named.joint + "' has no range, so " + shown(over[0]) + " to " +
                      shown(over[1]) + " cannot be spread over it: give it a range in the model");
  }
  const double factor = (range.high - range.low) / (over[1] - over[0]);
  return {factor, range.low - over[0] * factor};
}

bool JointFace::moves(int position) const noexcept {
  return std::ranges::any_of(states, [&](const Number& number) {
    return number.quantity == Quantity::position && number.address == position;
  });
}

/// Makes viewers spread a share with bounds over the joint's range.
bool JointFace::is_shown(const mjModel& model, const Number& number) const {
  if (number.line.factor == 1) return true;
  for (const ActuatorRow& actuator : schema.actuators) {
    if (actuator.offset != number.offset) continue;
    const LimitRow& row = schema.limits[actuator.first_limit];
    const mjtNum* range = model.jnt_range + 2 * number.joint;
    const double slack = 1e-3 * (range[1] - range[0]);
    return schema.fields[schema.types[actuator.type].first_field].unit.view() == "1" &&
           std::abs(number.line.of(row.minimum) - range[0]) <= slack &&
           std::abs(number.line.of(row.maximum) - range[1]) <= slack;
  }
  return false;
}

void JointFace::show(const mjModel& model, ShownModel& shown) const {
  for (const Number& number : states) {
    if (number.quantity != Quantity::position || !is_shown(model, number)) continue;
    shown.joint(name_of(model, mjOBJ_JOINT, number.joint, "joint"), number.offset);
  }
}

void JointFace::drive(const std::byte* block, mjData& data) const noexcept {
  for (const Input& input : inputs) {
    double number = 0;
    std::memcpy(&number, block + input.offset, sizeof number);
    data.ctrl[input.control] = input.line.of(number);
  }
}

void JointFace::hold(mjData& data) const noexcept {
  for (const Input& input : inputs) {
    data.ctrl[input.control] = input.hold.of(input.position < 0 ? 0 : data.qpos[input.position]);
  }
}

// force = gain x input + bias
void JointFace::weaken(double share, const mjModel& model, mjData& data) const noexcept {
  for (const Input& input : inputs) {
    if (!input.weakens && share > 0) continue;
    const int id = input.actuator;
    const int joint = model.actuator_trnid[2 * id];
    const double gear = model.actuator_gear[6 * model.actuator_outadr[id]];
    const double gain = model.actuator_gainprm[mjNGAIN * id];
    const mjtNum* bias = model.actuator_biasprm + mjNBIAS * id;
    const double given = model.actuator_biastype[id] == mjBIAS_NONE
                             ? 0
                             : bias[0] + gear * (bias[1] * data.qpos[model.jnt_qposadr[joint]] +
                                                 bias[2] * data.qvel[model.jnt_dofadr[joint]]);
    const double force = std::clamp(gain * data.ctrl[input.control] + given,
                                    share * model.actuator_forcerange[2 * id],
                                    share * model.actuator_forcerange[2 * id + 1]);
    data.ctrl[input.control] = (force - given) / gain;
  }
}

void JointFace::observe(const mjData& data, std::byte* block) const noexcept {
  put(data, states, block);
}

void JointFace::extend(const mjData& data, std::int64_t time, std::byte* extended) const noexcept {
  if (!absent.empty()) std::memcpy(extended, absent.data(), absent.size());
  put(data, sensors, extended);
  for (const std::uint32_t offset : capture_times) {
    std::memcpy(extended + offset, &time, sizeof time);
  }
}

JointFace joint_face(const mjModel& model, const Config& config) {
  return std::move(Builder(model, config).face);
}

}  // namespace o80::mujoco
