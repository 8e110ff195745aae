"""The arm of the scene: joints, lengths, masses, and the pose of the racket.

At zero angles the arm points straight upwards. Joint 1 turns the arm about the vertical, joints 2
and 3 bend it in a vertical plane, joint 4 turns the forearm about its axis.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from o80.base.arrays import FloatArray

from .scene import Vector, body, element, full_size, geom, joints_of, numbers, vector

_JOINTS = joints_of("shoulder")
JOINT_NAMES = tuple(joint.attrib["name"] for joint in _JOINTS)
"""Names of the joints, from the base to the wrist."""
JOINTS = len(JOINT_NAMES)
MUSCLES = 2 * JOINTS
"""Number of muscles: an agonist and an antagonist for each joint."""
JOINT_LIMIT = math.radians(numbers(element("default/joint"), "range")[1])
"""Limit of every joint, either way [rad]."""
JOINT_DAMPING = tuple(numbers(joint, "damping")[0] for joint in _JOINTS)
"""[Nm s/rad]"""

PLAYING_POSTURE = (0.17, 1.1, 1.04, 0.5)
"""Posture at the start of episodes: median of the real arm beside a tracked ball [rad]."""

SHOULDER = vector(body("shoulder"), "pos")[2] + vector(body("upper_arm"), "pos")[2]
"""Height of joint 2 above the floor, on the axis of joint 1 [m]."""
UPPER_ARM = vector(body("elbow"), "pos")[2]
"""Distance from joint 2 to joint 3 [m]."""
FOREARM = vector(body("racket"), "pos")[2]
"""Distance from joint 3 to the centre of the racket [m]."""
BLADE_THICKNESS = full_size(geom("racket"))[1]
"""Thickness of the racket's blade [m]."""


@dataclass(frozen=True)
class PointMass:
    """Point mass on the line of a link."""

    mass: float
    """[kg]"""
    centre: float
    """Distance from the joint that moves the mass [m]."""


def mass_of(name: str) -> PointMass:
    """Reads a body's own mass, and the place of its centre on the link."""
    inertial = element(f".//body[@name='{name}']/inertial")
    return PointMass(numbers(inertial, "mass")[0], vector(inertial, "pos")[2])


@dataclass(frozen=True)
class RacketPose:
    """Position and direction of the racket."""

    position: Vector
    """Position of the centre, in the world [m]."""
    normal: Vector
    """Unit normal of the face."""


def racket_pose(q: FloatArray) -> RacketPose:
    """Computes the racket's pose at angles q (4,) [rad]."""
    q1, q2, q3, q4 = q.tolist()
    c1, s1, c4, s4 = math.cos(q1), math.sin(q1), math.cos(q4), math.sin(q4)
    c23, s23 = math.cos(q2 + q3), math.sin(q2 + q3)
    out = UPPER_ARM * math.sin(q2) + FOREARM * s23
    height = SHOULDER + UPPER_ARM * math.cos(q2) + FOREARM * c23
    # face relative to the arm's vertical plane => in the world
    outwards, across, up = -s4 * c23, c4, s4 * s23
    normal = (c1 * outwards - s1 * across, s1 * outwards + c1 * across, up)
    return RacketPose((c1 * out, s1 * out, height), normal)
