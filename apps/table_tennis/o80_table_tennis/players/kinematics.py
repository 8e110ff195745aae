"""Where the racket is for given angles of the joints, and the angles that bring it to a point.

The figures are those of the scene's model, which a test holds together with these. At angles of
zero the arm is a straight line upwards; joint 1 turns it about the vertical, joints 2 and 3 bend it
in a vertical plane, joint 4 turns the forearm about itself.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

JOINTS = 4
SHOULDER = 1.21 + 0.075
"""Height of joint 2 above the floor, on the axis of joint 1 [m]."""
UPPER_ARM = 0.36742
"""Joint 2 to joint 3 [m]."""
FOREARM = 0.370
"""Joint 3 to the centre of the racket [m]."""
JOINT_LIMIT = math.radians(89.8)
"""Either way [rad]."""
BLADE_THICKNESS = 0.0054
"""Of the racket [m]."""

Vector = tuple[float, float, float]


@dataclass(frozen=True)
class RacketPose:
    """Where the racket is, and where it looks."""

    position: Vector
    """Of its centre, in the world [m]."""
    normal: Vector
    """Of its face, a unit vector."""


def racket_pose(q: FloatArray) -> RacketPose:
    """The racket at the angles q (4,) [rad]."""
    q1, q2, q3, q4 = q.tolist()
    c1, s1, c4, s4 = math.cos(q1), math.sin(q1), math.cos(q4), math.sin(q4)
    c23, s23 = math.cos(q2 + q3), math.sin(q2 + q3)
    out = UPPER_ARM * math.sin(q2) + FOREARM * s23
    height = SHOULDER + UPPER_ARM * math.cos(q2) + FOREARM * c23
    # the face in the vertical plane of the arm, across it and up => in the world
    outwards, across, up = -s4 * c23, c4, s4 * s23
    normal = (c1 * outwards - s1 * across, s1 * outwards + c1 * across, up)
    return RacketPose((c1 * out, s1 * out, height), normal)


def posture_towards(point: Vector, wrist: float) -> FloatArray:
    """Angles (4,) [rad], the elbow up, that bring the racket's centre to `point` of the world [m].

    `wrist` is the angle of joint 4. Where the joints do not reach: a posture near to the point.
    """
    x, y, z = point
    out, height = math.hypot(x, y), z - SHOULDER
    # the triangle of upper arm, forearm and the line from the shoulder to the racket
    square = out * out + height * height
    cosine = (square - UPPER_ARM**2 - FOREARM**2) / (2 * UPPER_ARM * FOREARM)
    bend = _held(math.acos(min(max(cosine, -1.0), 1.0)))
    lift = math.atan2(out, height) - math.atan2(
        FOREARM * math.sin(bend), UPPER_ARM + FOREARM * math.cos(bend)
    )
    if abs(lift) > JOINT_LIMIT:
        # the upper arm at its stop: the forearm points at the racket
        lift = _held(lift)
        elbow_out, elbow_height = UPPER_ARM * math.sin(lift), UPPER_ARM * math.cos(lift)
        bend = _held(math.atan2(out - elbow_out, height - elbow_height) - lift)
    return np.array([_held(math.atan2(y, x)), lift, bend, _held(wrist)])


def _held(angle: float) -> float:
    return min(max(angle, -JOINT_LIMIT), JOINT_LIMIT)
