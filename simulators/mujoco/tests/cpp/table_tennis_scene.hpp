#pragma once

// Simulations inside the test by the names of what they show, and the scene of most of them.

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

inline OptionValues table_tennis(OptionValues more = {}) {
  OptionValues options{
      {"model", O80_TEST_SOURCE "/apps/table_tennis/o80_table_tennis/world/table_tennis.xml"},
      {"balls", "ball"},
      {"racket", "racket"},
      {"table", "table"},
      {"net", "net"},
      {"floor", "floor"}};
  for (auto& option : more) options.push_back(std::move(option));
  return options;
}

/// One row of a simulation, by names.
struct Seen {
  UntypedObservation row;

  const FieldRow& sensor(std::string_view name) const {
    const Schema& schema = row.schema();
    const TypeRow& type = schema.types.at(schema.head.extended);
    for (std::uint32_t i = 0; i < type.fields; ++i) {
      const FieldRow& field = schema.fields[type.first_field + i];
      if (field.name.view() == name) return field;
    }
    throw std::out_of_range("no sensor " + std::string(name));
  }
  template <class T>
  T extended(std::string_view name, std::size_t element = 0) const {
    return unpack<T>(row.extended() + sensor(name).offset + element * sizeof(T));
  }
  BallRecord record(std::size_t ball = 0) const { return extended<BallRecord>("contacts", ball); }
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

/// Puts the arm where its racket looks along y, 0.37 m + ... above the base.
inline constexpr std::array<double, 4> kPosture{0.1, 0.9, 0.4, -0.2};

inline void pose_arm(Inline& twin, const std::array<double, 4>& q,
                     const std::array<double, 4>& dq = {}) {
  for (std::size_t j = 0; j < 4; ++j) {
    twin.ask("joint_" + std::to_string(j + 1), JointState{q[j], dq[j]});
  }
}

/// Replays a straight way of a ball that ends behind the racket, from 10 cm before it.
struct Shot {
  Vector from, velocity;
  BallState at(int i) const { return {numbers(from + (i * 0.002) * velocity), numbers(velocity)}; }
};
inline Shot shot_at_the_racket(Inline& twin) {
  pose_arm(twin, kPosture);
  const Seen now = twin.burst(2);
  const Vector racket = vector(now.extended<Numbers>("racket_position"));
  return {racket + Vector{0, 0.12, 0.02}, {0, -4, -0.5}};
}

class MujocoDriverTest : public testing::Test {
 protected:
  PrivateDirectory directory_;

  std::string file(const std::string& name, const std::string& text) {
    const std::string path = directory_.path() + "/" + name;
    std::ofstream(path) << text;
    return path;
  }
};

}  // namespace o80::mujoco
