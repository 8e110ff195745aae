"""Torques that move the arm: a model with its masses on points of the links.

It leaves out what feedback makes good: the speeds of joints 2 and 3 acting on each other, and the
couplings of the wrist.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .kinematics import UPPER_ARM

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class ArmModel:
    """Masses and friction, as the scene's model has them."""

    upper_mass: float = 0.208
    """[kg]"""
    upper_centre: float = 0.18371
    """From joint 2 [m]."""
    elbow_mass: float = 0.03
    """[kg]"""
    fore_mass: float = 0.797
    """Forearm and racket [kg]."""
    fore_centre: float = 0.33279
    """From joint 3 [m]."""
    turning: tuple[float, float, float, float] = (0.012, 0.0145, 0.0115, 0.004)
    """Inertia of the links about their own centres, and of the pulleys, for each joint [kg m^2]."""
    damping: tuple[float, float, float, float] = (2.0, 2.0, 1.2, 1.5)
    """[Nm s/rad]"""
    gravity: float = 9.81
    """[m/s^2]"""

    def torque(self, q: FloatArray, dq: FloatArray, acceleration: FloatArray) -> FloatArray:
        """What the muscles have to give (4,) [Nm] for angles, speeds and accelerations (4,)."""
        a1, a2, a3, a4 = acceleration.tolist()
        w1, w2, w3, _ = dq.tolist()
        t1, t2, t3, t4 = self.turning
        torque1, torque2, torque3 = t1 * a1, t2 * a2, t3 * a3
        for mass, along_upper, along_fore in self._points():
            out2, up2 = along_upper * math.sin(q[1]), along_upper * math.cos(q[1])
            out3, up3 = along_fore * math.sin(q[1] + q[2]), along_fore * math.cos(q[1] + q[2])
            out, up = out2 + out3, up2 + up3
            # turning about the vertical, and what it pulls outwards
            torque1 += mass * out * (out * a1 + 2.0 * w1 * (up * w2 + up3 * w3))
            away = -out * w1 * w1
            # the vertical plane, gravity as an acceleration upwards
            outwards = up * a2 + up3 * a3 + away
            upwards = -out * a2 - out3 * a3 + self.gravity
            torque2 += mass * (up * outwards - out * upwards)
            torque3 += mass * (up3 * outwards - out3 * upwards)
        return np.array([torque1, torque2, torque3, t4 * a4]) + np.array(self.damping) * dq

    def _points(self) -> tuple[tuple[float, float, float], ...]:
        """Mass [kg], and how far it lies along the upper arm and the forearm [m]."""
        return (
            (self.upper_mass, self.upper_centre, 0.0),
            (self.elbow_mass, UPPER_ARM, 0.0),
            (self.fore_mass, UPPER_ARM, self.fore_centre),
        )
