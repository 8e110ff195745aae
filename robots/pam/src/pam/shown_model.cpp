#include "pam/shown_model.hpp"

#include <array>
#include <cstdio>
#include <stdexcept>
#include <string>

#include "pam/arm.hpp"

namespace o80::pam {
namespace {

// The frame is below the base; each link is along z from its joint.
constexpr const char* kModel = R"(<mujoco model="pam">
  <compiler angle="radian"/>
  <statistic center="0 0 %g" extent="1.4"/>
  <default>
    <geom rgba="0.93 0.93 0.91 1"/>
    <default class="pulley"><geom type="cylinder" size="0.037 0.014" zaxis="0 1 0" rgba="0.24 0.25 0.28 1"/></default>
    <joint range="%g %g"/>
  </default>
  <worldbody>
    <geom name="floor" type="plane" size="3 3 0.1" rgba="0.60 0.62 0.63 1"/>
    <geom name="frame" type="box" pos="0 0 %g" size="0.12 0.12 %g" rgba="0.36 0.38 0.42 1"/>
    <body name="shoulder" pos="%g %g %g">
      <joint name="joint_1" axis="0 0 1"/>
      <geom type="cylinder" pos="0 0 0.02" size="0.037 0.02" rgba="0.24 0.25 0.28 1"/>
      <body name="upper_arm" pos="0 0 %g">
        <joint name="joint_2" axis="0 1 0"/>
        <geom class="pulley"/>
        <geom type="capsule" fromto="0 0 0 0 0 %g" size="0.013"/>
        <body name="elbow" pos="0 0 %g">
          <joint name="joint_3" axis="0 1 0"/>
          <geom class="pulley"/>
          <body name="forearm">
            <joint name="joint_4" axis="0 0 1"/>
            <geom type="capsule" fromto="0 0 0 0 0 %g" size="0.013"/>
            <geom name="racket" type="ellipsoid" pos="0 0 %g" size="%g %g %g" rgba="0.78 0.10 0.10 1"/>
          </body>
        </body>
      </body>
    </body>
  </worldbody>
)";

template <std::size_t N>
std::string numeric(const char* name, const std::array<double, N>& values) {
  std::string text = std::string("    <numeric name=\"") + name + "\" data=\"";
  for (const double value : values) {
    std::array<char, 32> number{};
    std::snprintf(number.data(), number.size(), "%.17g ", value);
    text += number.data();
  }
  text.back() = '"';
  return text + "/>\n";
}

/// Numbers for each joint, or each muscle.
std::string numbers_of(const Plant::Config& config) {
  std::array<double, kMuscles> idle{};
  std::array<double, kMuscles> full{};
  for (std::size_t m = 0; m < kMuscles; ++m) {
    idle[m] = config.ranges[m].idle;
    full[m] = config.ranges[m].full;
  }
  const LinearMuscle linear;
  const std::array<double, 1> contraction{linear.full_force_length - kRestLength};
  const char* law = config.muscle == MuscleModel::hill ? "hill" : "linear";
  return std::string("  <custom>\n    <text name=\"muscle\" data=\"") + law + "\"/>\n" +
         numeric("idle_pressure", idle) + numeric("full_pressure", full) +
         numeric("maximum_force", config.maximum_force) + numeric("stroke", config.stroke) +
         numeric("contraction", contraction) +
         numeric("pulley_radius", std::array<double, 1>{kPulleyRadius}) +
         numeric("neutral", config.neutral) + numeric("directions", config.directions) +
         numeric("lag", config.lag) + numeric("dead_time", config.dead_time) +
         numeric("damping", config.arm.damping) + numeric("friction", config.arm.friction) +
         "  </custom>\n";
}

}  // namespace

std::string shown_model(const Plant::Config& config) {
  const Vector base = Arm::Config{}.base;
  const double handle = kForearmLength - kBladeHalfLength;
  std::array<char, 4096> text{};
  const int length = std::snprintf(
      text.data(), text.size(), kModel, base[2], -kJointLimit, kJointLimit, 0.5 * base[2],
      0.5 * base[2], base[0], base[1], base[2], kShoulderHeight, kUpperArmLength, kUpperArmLength,
      handle, kForearmLength, kBladeHalfWidth, 0.5 * kBladeThickness, kBladeHalfLength);
  if (length <= 0 || static_cast<std::size_t>(length) >= text.size()) {
    throw std::length_error("the text of the arm's model is longer than its buffer");
  }
  return std::string(text.data(), static_cast<std::size_t>(length)) + numbers_of(config) +
         "</mujoco>\n";
}

}  // namespace o80::pam
