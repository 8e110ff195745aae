#pragma once

#include <mujoco/mujoco.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "balls/ball_model.hpp"
#include "o80/robot.hpp"

namespace o80::mujoco {

/// Body with a free joint that is not a ball.
struct FreeBody {
  std::string name;
  int position;  // in qpos
  int velocity;  // in qvel
};

/// Lists the free bodies of a model, in model order, without balls.
std::vector<FreeBody> free_bodies_in(const mjModel& model, const std::vector<BallPlace>& balls);

/// Position and velocity of a free body, in the engine's form.
struct FreeBodyState {
  std::array<double, 3> position;
  std::array<double, 4> quaternion;
  std::array<double, 3> velocity;
  std::array<double, 3> angular_velocity;
};
O80_DESCRIBE(FreeBodyState, (position, "of the body's frame, in the world [m]"),
             (quaternion, "w, x, y, z"), (velocity, "in the world's axes [m/s]"),
             (angular_velocity, "in the body's axes [rad/s]"));
FreeBodyState state_of(const FreeBody& body, const mjData& data) noexcept;

/// Places a body. `body`, a number in the order of the free bodies, is
/// described as an enumeration of their names.
struct PlaceBody {
  static constexpr std::string_view kHelp = "put a free body to a place, with a velocity";
  std::uint32_t body;
  std::array<double, 3> position;
  std::array<double, 4> quaternion{1, 0, 0, 0};
  std::array<double, 3> velocity{};
  std::array<double, 3> angular_velocity{};
};
O80_DESCRIBE(PlaceBody, (body, "its name"), (position, "of the body's frame, in the world [m]"),
             (quaternion, "w, x, y, z; of any length but 0"),
             (velocity, "in the world's axes [m/s]"),
             (angular_velocity, "in the body's axes [rad/s]"));

/// Place of a body's state in the sensor values.
struct BodyRow {
  std::size_t body;  // index
  Place<FreeBodyState> place;
};
/// Adds a sensor value for each body with an unused name.
std::vector<BodyRow> add_body_sensors(Schema& schema, const std::vector<FreeBody>& bodies);

/// Adds the request `place` if there are bodies.
void add_place(Schema& schema, const std::vector<FreeBody>& bodies);

/// Clears the engine's accelerations, the first guess of the next step, so that the future does
/// not depend on the past.
Served place(const mjModel& model, mjData& data, const std::vector<FreeBody>& bodies,
             const PlaceBody& request) noexcept;

}  // namespace o80::mujoco
