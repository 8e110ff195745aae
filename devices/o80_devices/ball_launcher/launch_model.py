"""Model of the launcher: position, velocity and spin of a ball from angles and motor speeds.

In the frame of the launcher: the origin below the muzzle on the ground plane of the recording, x
forward, y to the left, z up. The wheels touch the ball at 120 degrees. The sum of the
wheel speeds sets the ball's speed, their differences the spin. The numbers are fitted to 13 of 25
recorded shots (see fit.py) with two wheel settings and one setting of the angles. The recordings
do not show the range of the angles, see `LaunchModel.azimuth_range`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from o80.base.arrays import FloatArray

HALF_CHORD = math.sin(math.radians(60.0))
"""Sideways distance of the upper wheels' contact points, in radii of the ball."""


@dataclass(frozen=True, eq=False)
class Launch:
    """State of a ball at the muzzle."""

    position: FloatArray
    """(3,) [m]"""
    velocity: FloatArray
    """(3,) [m/s]"""
    spin: FloatArray
    """(3,) [rad/s]"""

    def placed(self, position: tuple[float, float, float], yaw: float) -> Launch:
        """Transforms the launch to the world frame. position: [m]. yaw: [rad]."""
        c, s = math.cos(yaw), math.sin(yaw)
        turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        return Launch(
            turn @ self.position + np.array(position), turn @ self.velocity, turn @ self.spin
        )


@dataclass(frozen=True)
class LaunchModel:
    """Parameters of the launcher."""

    muzzle: tuple[float, float, float] = (0.0, -0.001, 1.057)
    """[m]"""
    azimuth: float = 0.0116
    """Azimuth at phi = 0.5 [rad]."""
    altitude: float = 0.3557
    """Altitude at theta = 0.5 with equal wheel speeds [rad]."""
    lift: float = 3.0e-5
    """Altitude per excess speed of the upper wheels [rad min]."""
    top_gain: float = 1.595e-3
    """Ball speed per speed of each upper wheel [m/s min]."""
    bottom_gain: float = 1.148e-3
    """Ball speed per speed of the lower wheel [m/s min]."""
    spin: float = 69.0
    """Top spin at equal wheel speeds [rad/s]."""
    spin_gain: float = 0.0787
    """Spin per difference of the wheel speeds [rad/s min]."""
    azimuth_range: float = 0.5
    """Range of the azimuth from phi = 0 to 1: assumed, not fitted [rad]."""
    altitude_range: float = 0.5
    """Range of the altitude from theta = 0 to 1: assumed, not fitted [rad]."""
    speed_scatter: float = 0.03
    """Standard deviation of the speed from shot to shot [m/s]."""
    azimuth_scatter: float = 0.005
    """[rad]"""
    altitude_scatter: float = 0.006
    """[rad]"""
    spin_scatter: float = 10.0
    """Standard deviation of the spin about each axis [rad/s]."""

    def launch(
        self,
        phi: float,
        theta: float,
        speeds: tuple[float, float, float],
        rng: np.random.Generator | None = None,
    ) -> Launch:
        """Computes a launch. speeds: motors top left, top right, bottom [1/min]. rng: source of
        the scatter; None: no scatter."""
        scatter = np.zeros(6) if rng is None else rng.standard_normal(6)
        left, right, bottom = speeds
        upper = (left + right) / 2
        azimuth = self.azimuth + self.azimuth_range * (phi - 0.5)
        azimuth += self.azimuth_scatter * scatter.item(0)
        altitude = self.altitude + self.altitude_range * (theta - 0.5)
        altitude += self.lift * (upper - bottom) + self.altitude_scatter * scatter.item(1)
        speed = self.top_gain * (left + right) + self.bottom_gain * bottom
        speed += self.speed_scatter * scatter.item(2) if speed > 0.0 else 0.0

        # top spin turns a forward ball about +y; spin about +z turns it to the left
        forward = np.array([math.cos(azimuth), math.sin(azimuth), 0.0])
        left_of = np.array([-forward[1], forward[0], 0.0])
        up = np.array([0.0, 0.0, 1.0])
        ahead = math.cos(altitude) * forward + math.sin(altitude) * up
        top = self.spin + self.spin_gain * (upper - bottom)
        side = -self.spin_gain * HALF_CHORD * (left - right)
        spin = top * left_of + side * np.cross(ahead, left_of)
        return Launch(
            np.array(self.muzzle), max(0.0, speed) * ahead, spin + self.spin_scatter * scatter[3:]
        )


LAUNCH_MODEL = LaunchModel()
"""Model fitted to the recorded shots."""
