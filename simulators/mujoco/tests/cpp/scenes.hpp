#pragma once

// Simulations inside the test, rows read by names, and the options of the models of these tests.

#include <gtest/gtest.h>

#include <array>
#include <cstdint>
#include <fstream>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "driver/driver.hpp"
#include "memory/private_directory.hpp"
#include "robot/inline_simulation.hpp"

namespace o80::mujoco {

using Numbers = std::array<double, 3>;
using Row = InlineSimulation::Row;

/// Options, of which those of `more` replace others.
inline OptionValues with(OptionValues options, const OptionValues& more) {
  for (const auto& option : more) {
    std::erase_if(options, [&](const auto& known) { return known.first == option.first; });
    options.push_back(option);
  }
  return options;
}

/// Options for models/court.xml with one ball and four surfaces.
inline OptionValues court(const OptionValues& more = {}) {
  return with(
      {{"model", O80_TEST_SOURCE "/simulators/mujoco/tests/models/court.xml"},
       {"balls", "ball"},
       {"surfaces", "paddle=0.78, bench=0.7 0.7 0.92, fence=0.5 0.5 0.15, ground=0.7 0.7 0.75"},
       {"watched", "paddle"},
       {"spin", "30,0,0"},
       {"spin_decay", "0.5"}},
      more);
}

/// Options for models/pendulum.xml, controlled by its motor.
inline OptionValues pendulum(const OptionValues& more = {}) {
  return with({{"model", O80_TEST_SOURCE "/simulators/mujoco/tests/models/pendulum.xml"},
               {"mode", "control"}},
              more);
}

/// One row of a simulation, by names.
struct Seen {
  UntypedObservation row;

  const FieldRow& field_of(std::uint32_t type, std::string_view name) const {
    const Schema& schema = row.schema();
    const TypeRow& fields = schema.types.at(type);
    for (std::uint32_t i = 0; i < fields.fields; ++i) {
      const FieldRow& field = schema.fields[fields.first_field + i];
      if (field.name.view() == name) return field;
    }
    throw std::out_of_range("no field " + std::string(name));
  }
  const FieldRow& sensor(std::string_view name) const {
    return field_of(row.schema().head.extended, name);
  }
  template <class T>
  T extended(std::string_view name, std::size_t element = 0) const {
    return unpack<T>(row.extended() + sensor(name).offset + element * sizeof(T));
  }
  /// Contacts of a ball with a surface.
  template <class Contacts>
  Contacts contacts(std::string_view surface, std::size_t ball) const {
    const FieldRow& all = sensor("contacts");
    const FieldRow& field = field_of(all.type, surface);
    return unpack<Contacts>(row.extended() + all.offset + ball * all.size + field.offset);
  }
  WatchedContacts paddle(std::size_t ball = 0) const {
    return contacts<WatchedContacts>("paddle", ball);
  }
  SurfaceContacts bench(std::size_t ball = 0) const {
    return contacts<SurfaceContacts>("bench", ball);
  }
  template <class T>
  T observed(std::uint32_t actuator) const {
    return unpack<T>(row.observed() + row.schema().actuators[actuator].offset);
  }
  template <class T>
  T desired(std::uint32_t actuator) const {
    return unpack<T>(row.desired() + row.schema().actuators[actuator].offset);
  }
};

/// A simulation inside this process, with a frontend.
struct Inline : InlineSimulation {
  explicit Inline(const OptionValues& options, std::int64_t period = kPeriod)
      : InlineSimulation("mujoco", *robot_table<MujocoDriver>("mujoco"), options, period) {}

  std::uint32_t at(std::string_view name) const { return frontend.actuator(name); }
  Seen latest() { return {frontend.latest()}; }
  Seen burst(std::int64_t n) { return {InlineSimulation::burst(n)}; }
};

/// A posture in which the paddle looks along y.
inline constexpr std::array<double, 4> kPosture{0.1, 0.9, 0.4, -0.2};

inline void pose_arm(Inline& twin, const std::array<double, 4>& q,
                     const std::array<double, 4>& dq = {}) {
  for (std::size_t j = 0; j < 4; ++j) {
    twin.ask("joint_" + std::to_string(j + 1), JointState{q[j], dq[j]});
  }
}

/// A straight path of a ball, which ends behind the paddle.
struct Shot {
  Vector from, velocity;
  Vector spin{30, 0, 0};
  BallState at(int i) const {
    return {numbers(from + (i * 0.002) * velocity), numbers(velocity), numbers(spin)};
  }
};
inline Shot shot_at_the_paddle(Inline& twin) {
  pose_arm(twin, kPosture);
  const Seen now = twin.burst(2);
  const Vector paddle = vector(now.extended<Numbers>("paddle_position"));
  return {paddle + Vector{0, 0.12, 0.02}, {0, -4, -0.5}};
}

class SceneTest : public testing::Test {
 protected:
  PrivateDirectory directory_;

  std::string file(const std::string& name, const std::string& text) {
    const std::string path = directory_.path() + "/" + name;
    std::ofstream(path) << text;
    return path;
  }
};

}  // namespace o80::mujoco
