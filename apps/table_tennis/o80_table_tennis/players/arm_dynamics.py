"""Model of the arm's torques, with point masses on the links.

The model omits effects that feedback corrects: the coupling of the speeds of joints 2 and 3, and
the couplings of the wrist.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from o80.base.arrays import FloatArray

from ..world.arm import FOREARM, JOINT_DAMPING, UPPER_ARM, PointMass, mass_of
from ..world.ball import GRAVITY


def _joined(*parts: tuple[PointMass, float]) -> PointMass:
    """Merges point masses of a link, each given with its origin along the link; rounds to 10 um."""
    mass = sum(part.mass for part, _ in parts)
    centre = sum(part.mass * (origin + part.centre) for part, origin in parts) / mass
    return PointMass(mass, round(centre, 5))


UPPER_ARM_MASS, ELBOW_MASS = mass_of("upper_arm"), mass_of("elbow")
FOREARM_MASS = _joined((mass_of("forearm"), 0.0), (mass_of("racket"), FOREARM))
"""Merged mass of forearm and racket."""
TURNING = (0.012, 0.0145, 0.0115, 0.004)
"""Inertia of links about their centres, and of pulleys, for each joint, fitted to the
scene's torques [kg m^2]."""


@dataclass(frozen=True)
class ArmModel:
    """Model of the arm: masses of the scene, and damping."""

    damping: tuple[float, ...] = JOINT_DAMPING
    """[Nm s/rad]"""

    def torque(self, q: FloatArray, dq: FloatArray, acceleration: FloatArray) -> FloatArray:
        """Computes the muscles' torques (4,) [Nm] from angles, speeds and accelerations (4,)."""
        a1, a2, a3, a4 = acceleration.tolist()
        w1, w2, w3, _ = dq.tolist()
        t1, t2, t3, t4 = TURNING
        torque1, torque2, torque3 = t1 * a1, t2 * a2, t3 * a3
        for mass, out, up, out3, up3 in points(q):
            # rotation about the vertical, and centrifugal force
            torque1 += mass * out * (out * a1 + 2.0 * w1 * (up * w2 + up3 * w3))
            away = -out * w1 * w1
            # motion in the vertical plane; gravity is an upward acceleration
            outwards = up * a2 + up3 * a3 + away
            upwards = -out * a2 - out3 * a3 + GRAVITY
            torque2 += mass * (up * outwards - out * upwards)
            torque3 += mass * (up3 * outwards - out3 * upwards)
        return np.array([torque1, torque2, torque3, t4 * a4]) + np.array(self.damping) * dq

    def speeds_after(
        self, q: FloatArray, dq: FloatArray, torque: FloatArray, duration: float
    ) -> FloatArray:
        """Computes the speeds (4,) after `duration` [s] of torques (4,), with implicit damping."""
        at_rest = np.zeros_like(q)
        bias = self.torque(q, dq, at_rest) - np.array(self.damping) * dq
        # joint 1 turns the plane in which joints 2 and 3 bend the arm
        mass = np.diag(np.array(TURNING) + duration * np.array(self.damping))
        for weight, out, up, out3, up3 in points(q):
            mass[0, 0] += weight * out * out
            mass[1, 1] += weight * (up * up + out * out)
            mass[1, 2] += weight * (up * up3 + out * out3)
            mass[2, 1] += weight * (up3 * up + out3 * out)
            mass[2, 2] += weight * (up3 * up3 + out3 * out3)
        change = np.linalg.solve(mass, duration * (torque - bias - np.array(self.damping) * dq))
        result: FloatArray = dq + change
        return result


def points(q: FloatArray) -> Iterator[tuple[float, float, float, float, float]]:
    """Yields masses [kg] with distances out and up from joint 2, then from joint 3 [m]."""
    s2, c2 = math.sin(q[1]), math.cos(q[1])
    s23, c23 = math.sin(q[1] + q[2]), math.cos(q[1] + q[2])
    for mass, along_upper, along_fore in (
        (UPPER_ARM_MASS.mass, UPPER_ARM_MASS.centre, 0.0),
        (ELBOW_MASS.mass, UPPER_ARM, 0.0),
        (FOREARM_MASS.mass, UPPER_ARM, FOREARM_MASS.centre),
    ):
        out3, up3 = along_fore * s23, along_fore * c23
        yield mass, along_upper * s2 + out3, along_upper * c2 + up3, out3, up3
