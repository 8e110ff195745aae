"""Computes joint angles that bring the racket to a point."""

from __future__ import annotations

import math

import numpy as np

from o80.base.arrays import FloatArray

from ..world.arm import FOREARM, JOINT_LIMIT, SHOULDER, UPPER_ARM
from ..world.scene import Vector


def posture_towards(point: Vector, wrist: float) -> FloatArray:
    """Computes angles (4,) [rad], elbow up, that bring the racket's centre to `point` [m].

    `wrist`: angle of joint 4. A point out of reach gives a posture near to it.
    """
    x, y, z = point
    out, height = math.hypot(x, y), z - SHOULDER
    # triangle of upper arm, forearm and the line from shoulder to racket
    square = out * out + height * height
    cosine = (square - UPPER_ARM**2 - FOREARM**2) / (2 * UPPER_ARM * FOREARM)
    bend = _held(math.acos(min(max(cosine, -1.0), 1.0)))
    lift = math.atan2(out, height) - math.atan2(
        FOREARM * math.sin(bend), UPPER_ARM + FOREARM * math.cos(bend)
    )
    if abs(lift) > JOINT_LIMIT:
        # upper arm at its stop: the forearm points at the racket
        lift = _held(lift)
        elbow_out, elbow_height = UPPER_ARM * math.sin(lift), UPPER_ARM * math.cos(lift)
        bend = _held(math.atan2(out - elbow_out, height - elbow_height) - lift)
    return np.array([_held(math.atan2(y, x)), lift, bend, _held(wrist)])


def _held(angle: float) -> float:
    return min(max(angle, -JOINT_LIMIT), JOINT_LIMIT)
