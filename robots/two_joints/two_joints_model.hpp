#pragma once

#include <string_view>

/// Model for `o80 view`: two links in a plane.
inline constexpr std::string_view kTwoJointsModel = R"(<mujoco model="two_joints">
  <statistic center="0 0 0.3" extent="1.2"/>
  <default>
    <geom rgba="0.90 0.91 0.93 1"/>
    <default class="motor"><geom type="cylinder" size="0.06 0.05" zaxis="0 1 0" rgba="0.20 0.23 0.28 1"/></default>
  </default>
  <worldbody>
    <geom name="floor" type="plane" size="2 2 0.1" rgba="0.55 0.58 0.60 1"/>
    <geom name="base" type="cylinder" pos="0 0 0.05" size="0.12 0.05" rgba="0.20 0.23 0.28 1"/>
    <geom name="post" type="cylinder" pos="0 0 0.15" size="0.04 0.1" rgba="0.20 0.23 0.28 1"/>
    <body name="upper" pos="0 0 0.3">
      <joint name="shoulder" axis="0 1 0"/>
      <geom class="motor"/>
      <geom type="capsule" fromto="0 0 0 0 0 0.4" size="0.035"/>
      <body name="lower" pos="0 0 0.4">
        <joint name="elbow" axis="0 1 0"/>
        <geom class="motor"/>
        <geom type="capsule" fromto="0 0 0 0 0 0.3" size="0.03" rgba="0.93 0.52 0.18 1"/>
      </body>
    </body>
  </worldbody>
</mujoco>
)";
