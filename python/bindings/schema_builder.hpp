#pragma once

#include <nanobind/nanobind.h>

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "o80/describe/schema.hpp"
#include "o80/runtime/observation.hpp"

/// A schema that Python code fills.
struct SchemaBuilder {
  o80::Schema schema;

  explicit SchemaBuilder(const std::string& robot) { schema.head.robot = o80::NameText(robot); }

  /// Adds a type with these fields: (name, kind, shape, text, labels or None, type).
  std::uint32_t add_type(const std::string& name, const nanobind::list& fields);

  std::uint32_t add_actuators(const std::string& group, std::uint32_t type, std::uint32_t count,
                              bool is_array) {
    return schema.add_actuators(group, type, count, is_array);
  }

  void set_extended(std::uint32_t type) { schema.head.extended = type; }

  void add_request(const std::string& name, std::uint32_t type, const std::string& help,
                   bool while_halted) {
    schema.add_request(name, type, help, while_halted);
  }

  void name_actuator(std::uint32_t actuator, const std::string& name) {
    schema.actuator(actuator).name(name);
  }

  void set_follow(std::uint32_t actuator) {
    schema.actuator(actuator).when_idle(o80::WhenIdle::follow);
  }

  std::vector<std::string> actuators() const {
    std::vector<std::string> names;
    for (const o80::ActuatorRow& row : schema.actuators) names.push_back(row.name.str());
    return names;
  }

  /// Sets the limits of a field (empty: the first number), in the order of o80::Limits, and of its
  /// integral (empty: none), in the order of o80::IntegralBounds.
  void set_limits(std::uint32_t actuator, const std::string& field,
                  const std::array<double, 7>& given, const std::string& integral,
                  const std::array<double, 3>& bounds) {
    o80::Limits limits{given[0], given[1], given[2], given[3], given[4], given[5], given[6]};
    if (!integral.empty()) limits.integral = {integral, bounds[0], bounds[1], bounds[2]};
    schema.actuator(actuator).limits(field, limits);
  }

  void rests_at(std::uint32_t actuator, const std::string& field, double value) {
    schema.actuator(actuator).rests_at(field, value);
  }

  void simulated(bool is) { schema.head.of_the_world = is ? 2 : 3; }
  void gap(std::int64_t longest) { schema.gap(longest); }

  /// The schema as readers see it.
  std::shared_ptr<o80::Description> description() const;

  /// Sets the model that viewers draw.
  void set_model(const std::string& mjcf, const std::string& file) {
    schema.shown.mjcf = mjcf;
    schema.shown.file = file;
  }

  void moves_joint(std::uint32_t actuator, const std::string& joint) {
    schema.actuator(actuator).moves_joint(joint);
  }

  void sensor_moves_joint(const std::string& field, std::uint32_t index, const std::string& joint) {
    schema.sensor_moves_joint(field, index, joint);
  }

 private:
  o80::FieldRow member(const nanobind::tuple& row);
  void add_labels(o80::FieldRow& field, const nanobind::dict& labels);
};

void bind_schema_builder(nanobind::module_& m);
