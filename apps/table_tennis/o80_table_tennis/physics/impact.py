"""What a ball keeps of its velocity at an impact: at rest on the table, or by a moving racket.

The twins follow the same law in C++ (simulators/mujoco/src/balls/), for any surface and motion; a
test compares the two.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..world.materials import Restitution
from ..world.table import TABLE, Table
from .aerodynamics import State

FloatArray = NDArray[np.float64]

SLOWEST_REBOUND = 0.05
"""A ball leaves the table at least this fast [m/s]: it hops on, it never rests."""


def bounced(state: State[float], table: Table = TABLE) -> State[float]:
    """The state after the touch of the table: shares of its velocity kept, its spin unchanged."""
    x, y, z, vx, vy, vz = state
    tangential = table.tangential_restitution
    rebound = max(table.normal_restitution * abs(vz), SLOWEST_REBOUND)
    return (x, y, z, tangential * vx, tangential * vy, rebound)


def outgoing_velocity(
    ball: FloatArray, racket: FloatArray, normal: FloatArray, restitution: Restitution
) -> FloatArray:
    """Velocity (3,) of the ball afterwards, from those of ball and racket and the unit normal."""
    relative = ball - racket
    along = float(relative @ normal)
    kept: FloatArray = restitution.tangential * relative
    return racket + kept - (restitution.tangential + restitution.normal) * along * normal
