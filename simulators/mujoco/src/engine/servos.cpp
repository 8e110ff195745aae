#include "engine/servos.hpp"

#include <algorithm>
#include <utility>

namespace o80::mujoco {
namespace {

bool drives_one_joint(const mjModel& model, int actuator) {
  const int transmission = model.actuator_trntype[actuator];
  if (transmission != mjTRN_JOINT && transmission != mjTRN_JOINTINPARENT) return false;
  const int type = model.jnt_type[model.actuator_trnid[2 * actuator]];
  const int bias = model.actuator_biastype[actuator];
  return (type == mjJNT_HINGE || type == mjJNT_SLIDE) && model.actuator_ctrlnum[actuator] == 1 &&
         model.actuator_gaintype[actuator] == mjGAIN_FIXED &&
         model.actuator_gainprm[mjNGAIN * actuator] != 0 &&
         model.actuator_gear[6 * model.actuator_outadr[actuator]] != 0 &&
         (bias == mjBIAS_NONE || bias == mjBIAS_AFFINE);
}

/// Meaning of the input: the number at which the force gain x input + b0 + b1 length + b2 velocity
/// is 0, or the force itself. The input of an integrator is the velocity of its position.
void set_input(const mjModel& model, int actuator, Servo& servo) {
  const double gear = model.actuator_gear[6 * model.actuator_outadr[actuator]];
  const double gain = model.actuator_gainprm[mjNGAIN * actuator];
  const mjtNum* bias = model.actuator_biasprm + mjNBIAS * actuator;
  const bool is_affine = model.actuator_biastype[actuator] == mjBIAS_AFFINE;
  const double shift = is_affine ? -bias[0] / gain : 0;
  if (is_affine && bias[1] != 0 && model.actuator_dyntype[actuator] == mjDYN_INTEGRATOR) {
    servo.commanded = Quantity::velocity;
    servo.input = {-bias[1] / gain * gear, 0};
  } else if (is_affine && bias[1] != 0) {
    servo.commanded = Quantity::position;
    servo.input = {-bias[1] / gain * gear, shift};
  } else if (is_affine && bias[2] != 0) {
    servo.commanded = Quantity::velocity;
    servo.input = {-bias[2] / gain * gear, shift};
  } else {
    servo.commanded = Quantity::effort;
    servo.input = {1 / (gain * gear), shift};
  }
}

}  // namespace

Range intersection(const Range& a, const Range& b) {
  return {std::max(a.low, b.low), std::min(a.high, b.high)};
}

std::vector<Servo> servos_in(const mjModel& model) {
  std::vector<Servo> servos;
  for (int i = 0; i < static_cast<int>(model.nactuator); ++i) {
    if (!drives_one_joint(model, i)) continue;
    Servo servo{};
    servo.actuator = i;
    servo.joint = model.actuator_trnid[2 * i];
    servo.control = model.actuator_ctrladr[i];
    set_input(model, i, servo);
    if (model.jnt_limited[servo.joint] != 0) {
      servo.positions = {model.jnt_range[2 * servo.joint], model.jnt_range[2 * servo.joint + 1]};
    }
    if (model.actuator_ctrllimited[servo.control] != 0) {
      servo.allowed = {servo.input.back(model.actuator_ctrlrange[2 * servo.control]),
                       servo.input.back(model.actuator_ctrlrange[2 * servo.control + 1])};
      if (servo.input.factor < 0) std::swap(servo.allowed.low, servo.allowed.high);
    }
    if (servo.commanded == Quantity::position) {
      servo.allowed = intersection(servo.allowed, servo.positions);
    }
    servos.push_back(servo);
  }
  return servos;
}

}  // namespace o80::mujoco
