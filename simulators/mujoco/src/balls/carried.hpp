#pragma once

#include <mujoco/mujoco.h>

#include <algorithm>
#include <cstddef>
#include <vector>

#include "balls/vector.hpp"

namespace o80::mujoco {

/// Velocities of a point on a body.
struct Carried {
  Vector velocity{};  // [m/s]
  Vector spin{};      // [rad/s], in the world's axes
};

/// Joints that carry a body: its own, and its ancestors' joints.
inline std::vector<int> joints_under(const mjModel& model, int body) {
  std::vector<int> joints;
  for (; body != 0; body = model.body_parentid[body]) {
    for (int i = 0; i < model.body_jntnum[body]; ++i) {
      joints.push_back(model.body_jntadr[body] + i);
    }
  }
  return joints;
}

/// Computes the velocities of a point carried by these joints: the sum of their contributions.
/// Equal to mj_objectVelocity, without mj_comPos and mj_comVel, which process all bodies; uses
/// positions of joints and bodies of the last mj_kinematics.
inline Carried carried_by(const std::vector<int>& joints, const mjModel& model, const mjData& data,
                          const Vector& point) noexcept {
  const auto vector = [](const mjtNum* n) { return Vector{n[0], n[1], n[2]}; };
  Carried sum;
  const auto turn = [&](const Vector& spin, const Vector& about) {
    sum.spin = sum.spin + spin;
    sum.velocity = sum.velocity + cross(spin, point - about);
  };
  for (const int joint : joints) {
    const auto at = 3 * static_cast<std::ptrdiff_t>(joint);
    const auto body = static_cast<std::ptrdiff_t>(model.jnt_bodyid[joint]);
    const mjtNum* rate = data.qvel + model.jnt_dofadr[joint];
    // angular rates are in the body's axes, the columns of its matrix
    const auto own = [&](const mjtNum* spin) {
      Rotation rotation;
      std::copy_n(data.xmat + 9 * body, 9, rotation.m.begin());
      return rotation.out(vector(spin));
    };
    switch (model.jnt_type[joint]) {
      case mjJNT_HINGE:
        turn(rate[0] * vector(data.xaxis + at), vector(data.xanchor + at));
        break;
      case mjJNT_SLIDE:
        sum.velocity = sum.velocity + rate[0] * vector(data.xaxis + at);
        break;
      case mjJNT_BALL:
        turn(own(rate), vector(data.xanchor + at));
        break;
      default:  // free
        sum.velocity = sum.velocity + vector(rate);
        turn(own(rate + 3), vector(data.xpos + 3 * body));
    }
  }
  return sum;
}

}  // namespace o80::mujoco
