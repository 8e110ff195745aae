#include "balls/ball_rows.hpp"

namespace o80::mujoco {
namespace {

FieldRow structure_field(std::string_view name, std::uint32_t type, std::string_view text,
                         std::size_t count = 0) {
  FieldRow field = scalar_field(name, Kind::structure, text, static_cast<std::uint32_t>(count));
  field.type = type;
  return field;
}

}  // namespace

void BallRows::add_actuators(Schema& schema, const Balls& balls) {
  first_actuator_ = static_cast<std::uint32_t>(schema.actuators.size());
  const auto count = static_cast<std::uint32_t>(balls.size());
  schema.add_actuators("balls", describing::type_of<BallState>(schema), count);
  states_.resize(count);
  for (std::uint32_t i = 0; i < count; ++i) {
    schema.actuator(first_actuator_ + i).name(balls.places()[i].name).when_idle(WhenIdle::follow);
    states_[i].offset = schema.actuators[first_actuator_ + i].offset;
  }
}

void BallRows::add_sensors(Schema& schema, const Balls& balls) {
  watched_.clear();
  others_.clear();
  if (balls.surfaces().empty()) return;

  // one field for each surface
  std::vector<FieldRow> fields;
  for (const SurfacePlace& surface : balls.surfaces()) {
    const std::uint32_t type = surface.watched ? describing::type_of<WatchedContacts>(schema)
                                               : describing::type_of<SurfaceContacts>(schema);
    fields.push_back(
        structure_field(surface.name, type, surface.watched ? "a watched surface" : "a surface"));
  }
  const std::uint32_t contacts = schema.add_type("Contacts", fields);
  const TypeRow row = schema.types[contacts];
  contacts_size_ = row.size;
  std::vector<std::uint32_t> offsets;
  offsets.reserve(row.fields);
  for (std::uint32_t i = 0; i < row.fields; ++i) {
    offsets.push_back(schema.fields[row.first_field + i].offset);
  }

  // an array with an element for each ball
  const std::uint32_t first = schema.add_sensor(structure_field(
      "contacts", contacts, "of each ball with each surface since the last clear_contacts",
      balls.size()));
  for (std::size_t i = 0; i < offsets.size(); ++i) {
    (balls.surfaces()[i].watched ? watched_ : others_).push_back(first + offsets[i]);
  }
}

void BallRows::show(ShownModel& shown, const Balls& balls) const {
  for (std::size_t i = 0; i < balls.size(); ++i) {
    shown.position(balls.places()[i].name, states_[i].offset);
  }
}

void BallRows::go_on_from_targets(const Balls& balls, std::byte* desired) const {
  for (std::size_t i = 0; i < balls.size(); ++i) {
    pack(balls.targets()[i].state, desired + states_[i].offset);
  }
}

}  // namespace o80::mujoco
