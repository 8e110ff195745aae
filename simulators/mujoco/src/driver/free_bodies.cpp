#include "driver/free_bodies.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>

#include "engine/names.hpp"

namespace o80::mujoco {
namespace {

bool all_finite(std::span<const double> numbers) noexcept {
  return std::ranges::all_of(numbers, [](double each) { return std::isfinite(each); });
}

bool has_sensor(const Schema& schema, std::string_view name) {
  if (schema.head.extended == kNoType) return false;
  const TypeRow& type = schema.types[schema.head.extended];
  const auto fields = std::span(schema.fields).subspan(type.first_field, type.fields);
  return std::ranges::any_of(fields,
                             [&](const FieldRow& each) { return each.name.view() == name; });
}

}  // namespace

std::vector<FreeBody> free_bodies_in(const mjModel& model, const std::vector<BallPlace>& balls) {
  std::vector<FreeBody> bodies;
  for (int joint = 0; joint < static_cast<int>(model.njnt); ++joint) {
    const int position = model.jnt_qposadr[joint];
    if (model.jnt_type[joint] != mjJNT_FREE) continue;
    if (std::ranges::find(balls, position, &BallPlace::position) != balls.end()) continue;
    bodies.push_back({name_of(model, mjOBJ_BODY, model.jnt_bodyid[joint], "body"), position,
                      model.jnt_dofadr[joint]});
  }
  return bodies;
}

FreeBodyState state_of(const FreeBody& body, const mjData& data) noexcept {
  FreeBodyState state;
  const mjtNum* position = data.qpos + body.position;
  const mjtNum* velocity = data.qvel + body.velocity;
  std::copy_n(position, 3, state.position.begin());
  std::copy_n(position + 3, 4, state.quaternion.begin());
  std::copy_n(velocity, 3, state.velocity.begin());
  std::copy_n(velocity + 3, 3, state.angular_velocity.begin());
  return state;
}

std::vector<BodyRow> add_body_sensors(Schema& schema, const std::vector<FreeBody>& bodies) {
  std::vector<BodyRow> rows;
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    if (has_sensor(schema, bodies[i].name)) continue;
    FieldRow field = scalar_field(bodies[i].name, Kind::structure, "a body that moves freely");
    field.type = describing::type_of<FreeBodyState>(schema);
    rows.push_back({i, {schema.add_sensor(field)}});
  }
  return rows;
}

void add_place(Schema& schema, const std::vector<FreeBody>& bodies) {
  if (bodies.empty()) return;
  const std::uint32_t type = describing::type_of<PlaceBody>(schema);
  FieldRow& field = schema.fields[schema.types[type].first_field];
  field.kind = Kind::enumeration;
  field.first_label = static_cast<std::uint32_t>(schema.labels.size());
  field.labels = static_cast<std::uint32_t>(bodies.size());
  for (const FreeBody& body : bodies) {
    schema.labels.push_back({NameText(body.name), &body - bodies.data()});
  }
  schema.add_request("place", type, PlaceBody::kHelp, true);
}

Served place(const mjModel& model, mjData& data, const std::vector<FreeBody>& bodies,
             const PlaceBody& request) noexcept {
  if (request.body >= bodies.size()) return Served::rejected("there is no body of this number");
  const auto& quaternion = request.quaternion;
  if (!all_finite(request.position) || !all_finite(quaternion) || !all_finite(request.velocity) ||
      !all_finite(request.angular_velocity)) {
    return Served::rejected("position, quaternion and velocities must be finite numbers");
  }
  // divides by the largest number first, so that no square overflows or vanishes
  const double largest =
      std::abs(std::ranges::max(quaternion, {}, [](double x) { return std::abs(x); }));
  if (largest == 0) {
    return Served::rejected("the quaternion has the length 0: give 1 0 0 0 for no rotation");
  }
  mjtNum* at = data.qpos + bodies[request.body].position;
  std::ranges::copy(request.position, at);
  std::ranges::transform(quaternion, at + 3, [&](double each) { return each / largest; });
  mju_normalize4(at + 3);
  mjtNum* velocity = data.qvel + bodies[request.body].velocity;
  std::ranges::copy(request.velocity, velocity);
  std::ranges::copy(request.angular_velocity, velocity + 3);
  std::ranges::fill(std::span(data.qacc_warmstart, static_cast<std::size_t>(model.nv)), 0.0);
  return Served::done();
}

}  // namespace o80::mujoco
