"""Impact of a ball on the resting table, or on a moving racket.

Along the normal the ball keeps a share of its velocity. Friction acts on the slip, the velocity of
the ball's surface relative to the other one: a gripping ball loses a share of the slip, a sliding
one no more than friction allows, and the spin changes accordingly. The simulator implements
the law in C++ (`o80_mujoco.balls`); this module has the numbers of table, racket and ball.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np

from o80.base.arrays import FloatArray
from o80_mujoco.balls import Platform
from o80_mujoco.balls import bounced as bounced_off

from ..world.ball import BALL_INERTIA, BALL_RADIUS
from ..world.materials import RACKET_RESTITUTION
from ..world.table import TABLE, Table
from .aerodynamics import AERODYNAMICS


class Leaving(NamedTuple):
    """State of a ball after an impact."""

    velocity: FloatArray
    """(3,) [m/s]"""
    spin: FloatArray
    """(3,) [rad/s]"""


@cache
def platform(table: Table) -> Platform:
    """Converts the table to parameters for predictions."""
    (x, y, _), (width, length, _) = table.centre, table.size
    return Platform(
        height=table.bounce_height,
        low=(x - width / 2, y - length / 2),
        high=(x + width / 2, y + length / 2),
        restitution=(
            table.tangential_restitution,
            table.tangential_restitution,
            table.normal_restitution,
        ),
        friction=table.friction,
        radius=BALL_RADIUS,
        inertia=BALL_INERTIA,
    )


def bounced(velocity: FloatArray, spin: FloatArray, table: Table = TABLE) -> Leaving:
    """Computes a bounce on the table from velocity (3,) [m/s] and spin (3,) [rad/s]."""
    ball = np.concatenate([np.zeros(3), velocity, spin])[np.newaxis]
    after = platform(table).bounced(ball)[0]
    return Leaving(after[3:6], after[6:])


def spin_after(velocity: FloatArray, turn: FloatArray, spin: FloatArray | None) -> FloatArray:
    """Computes the spin (3,) [rad/s] after a bounce.

    `velocity` (1, 3) [m/s], `turn` (3,) [1/s] and `spin` (3,) [rad/s]: before the bounce; spin
    None: derived from the turn.
    """
    if spin is None:
        spin = AERODYNAMICS.spins(turn, np.linalg.norm(velocity, axis=1))[0]
    return bounced(velocity[0], spin).spin


def leaving(ball: FloatArray, spin: FloatArray, racket: FloatArray, normal: FloatArray) -> Leaving:
    """Computes the ball after an impact on a racket.

    `ball`, `spin` (3,): velocity and spin before the impact. `racket` (3,): velocity at the point
    of contact. `normal` (3,): unit normal of the face, on either side.
    """
    towards = normal if (ball - racket) @ normal <= 0.0 else -normal
    after = bounced_off(
        np.concatenate([np.zeros(3), ball, spin]),
        towards.tolist(),
        racket.tolist(),
        (RACKET_RESTITUTION.tangential, RACKET_RESTITUTION.tangential, RACKET_RESTITUTION.normal),
        RACKET_RESTITUTION.friction,
        radius=BALL_RADIUS,
        inertia=BALL_INERTIA,
    )
    return Leaving(after[3:6], after[6:])
