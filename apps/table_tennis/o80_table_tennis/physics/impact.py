"""What an impact does to a ball: at rest on the table, or by a moving racket.

Along the normal the ball keeps a share of its velocity. Friction acts on the slip, the velocity of
the ball's surface relative to the other one: it takes a share of the slip from the velocity while
the ball grips, no more than friction allows where it slides, and gives the same to the spin. The
twins follow the same law in C++ (simulators/mujoco/src/balls/bounce.hpp), for any surface and
motion; a test compares the two.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..world.ball import BALL_INERTIA, BALL_RADIUS, NO_SPIN
from ..world.materials import Restitution
from ..world.scene import Vector
from ..world.table import TABLE, Table
from .aerodynamics import State

FloatArray = NDArray[np.float64]

SLOWEST_REBOUND = 0.05
"""A ball leaves the table at least this fast [m/s]: it hops on, it never rests."""
SPIN_PER_VELOCITY = 1.0 / (BALL_INERTIA * BALL_RADIUS)
"""Change of the spin with a change of the tangential velocity [rad/m]."""


class Leaving(NamedTuple):
    """A ball after an impact."""

    velocity: FloatArray
    """(3,) [m/s]"""
    spin: FloatArray
    """(3,) [rad/s]"""


def bounced(
    state: State[float], spin: Vector = NO_SPIN, table: Table = TABLE
) -> tuple[State[float], Vector]:
    """State and spin [rad/s] after the touch of the table."""
    x, y, z, vx, vy, vz = state
    wx, wy, wz = spin
    rebound = max(table.normal_restitution * abs(vz), SLOWEST_REBOUND)

    # slip => what friction takes from the velocity
    grip = 1.0 - table.tangential_restitution
    taken_x, taken_y = grip * (vx - BALL_RADIUS * wy), grip * (vy + BALL_RADIUS * wx)
    taken = math.hypot(taken_x, taken_y)
    most = table.friction * (abs(vz) + rebound)
    if taken > most:
        taken_x, taken_y = taken_x * most / taken, taken_y * most / taken
    after = (
        wx - SPIN_PER_VELOCITY * taken_y,
        wy + SPIN_PER_VELOCITY * taken_x,
        wz,
    )
    return (x, y, z, vx - taken_x, vy - taken_y, rebound), after


def leaving(
    ball: FloatArray,
    spin: FloatArray,
    racket: FloatArray,
    normal: FloatArray,
    restitution: Restitution,
) -> Leaving:
    """The ball after an impact on a racket that grips: no ball slides on it.

    `ball` and `spin` (3,) are those before it, `racket` (3,) is the velocity of the racket at the
    point of contact and `normal` (3,) the unit normal of its face.
    """
    relative = ball - racket
    along = float(relative @ normal)
    slip = relative - along * normal - BALL_RADIUS * _cross(spin, normal)
    taken = restitution.grip * slip
    velocity = ball - taken - (1.0 + restitution.normal) * along * normal
    return Leaving(velocity, spin + SPIN_PER_VELOCITY * _cross(normal, taken))


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Faster than NumPy's for single vectors."""
    ax, ay, az = a.tolist()
    bx, by, bz = b.tolist()
    return np.array([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])
