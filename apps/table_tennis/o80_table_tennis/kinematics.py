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
BLADE = (0.5 * 0.1485, 0.5 * 0.1882)
"""Half axes of the elliptic blade, across and along the forearm [m]."""
BLADE_THICKNESS = 0.0054
"""[m]"""
REACH = UPPER_ARM + FOREARM
"""From joint 2 to the centre of the racket when the arm is straight [m]."""
SHORTEST_REACH = math.hypot(UPPER_ARM, FOREARM)
"""The same when the elbow is bent all it can, nearly a right angle [m]."""

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


def racket_jacobian(q: FloatArray) -> FloatArray:
    """Velocity of the racket's centre for each joint speed, (3, 4) [m]."""
    q1, q2, q3, _ = q.tolist()
    c1, s1, c2, s2 = math.cos(q1), math.sin(q1), math.cos(q2), math.sin(q2)
    c23, s23 = math.cos(q2 + q3), math.sin(q2 + q3)
    fore_out, fore_up = FOREARM * c23, -FOREARM * s23
    both_out, both_up = UPPER_ARM * c2 + fore_out, -UPPER_ARM * s2 + fore_up
    out = UPPER_ARM * s2 + FOREARM * s23
    return np.array(
        [
            [-s1 * out, c1 * both_out, c1 * fore_out, 0.0],
            [c1 * out, s1 * both_out, s1 * fore_out, 0.0],
            [0.0, both_up, fore_up, 0.0],
        ]
    )


def posture_reaching(point: Vector, wrist: float) -> FloatArray | None:
    """Angles (4,) [rad], the elbow up, with the racket's centre at `point` of the world [m].

    `wrist` is the angle of joint 4. None if the point is out of reach.
    """
    x, y, z = point
    out, height = math.hypot(x, y), z - SHOULDER
    cosine = (out * out + height * height - UPPER_ARM**2 - FOREARM**2) / (2 * UPPER_ARM * FOREARM)
    if abs(cosine) > 1.0:
        return None
    # the triangle of upper arm, forearm and the line from the shoulder to the racket
    bend = math.acos(cosine)
    lift = math.atan2(out, height) - math.atan2(
        FOREARM * math.sin(bend), UPPER_ARM + FOREARM * cosine
    )
    posture = np.array([math.atan2(y, x), lift, bend, wrist])
    return posture if bool(np.all(np.abs(posture) <= JOINT_LIMIT)) else None


def nearest_in_reach(point: Vector, *, margin: float = 0.01) -> Vector:
    """`point`, or where the line from the shoulder to it comes within reach [m].

    `margin` is kept from the straight arm and from the elbow's stop [m].
    """
    x, y, height = point[0], point[1], point[2] - SHOULDER
    distance = math.sqrt(x * x + y * y + height * height)
    scale = min(max(distance, SHORTEST_REACH + margin), REACH - margin) / distance
    return (scale * x, scale * y, SHOULDER + scale * height)
