"""Impact of a ball on the table, which is at rest, or on a moving racket.

Along the normal the ball keeps a share of its velocity. Friction acts on the slip, the velocity of
the ball's surface relative to the other one: it takes a share of the slip from the velocity while
the ball grips, no more than friction allows where it slides, and gives the same to the spin. The
law is the simulator's, in C++ (`o80_mujoco.balls`); here are the numbers of table, racket and ball.
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
    """A ball after an impact."""

    velocity: FloatArray
    """(3,) [m/s]"""
    spin: FloatArray
    """(3,) [rad/s]"""


@cache
def platform(table: Table) -> Platform:
    """The table, as predictions want it."""
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
    """A ball with this velocity (3,) [m/s] and spin (3,) [rad/s] after a touch of the table."""
    ball = np.concatenate([np.zeros(3), velocity, spin])[np.newaxis]
    after = platform(table).bounced(ball)[0]
    return Leaving(after[3:6], after[6:])


def spin_after(velocity: FloatArray, turn: FloatArray, spin: FloatArray | None) -> FloatArray:
    """Spin (3,) [rad/s] after a bounce, by the law of the bounce.

    `velocity` (1, 3) [m/s] and `turn` (3,) [1/s] are those before it, as is `spin` (3,) [rad/s];
    None: what the turn says.
    """
    if spin is None:
        spin = AERODYNAMICS.spins(turn, np.linalg.norm(velocity, axis=1))[0]
    return bounced(velocity[0], spin).spin


def leaving(ball: FloatArray, spin: FloatArray, racket: FloatArray, normal: FloatArray) -> Leaving:
    """The ball after an impact on a racket.

    `ball` and `spin` (3,) are those before it, `racket` (3,) is the velocity of the racket at the
    point of contact and `normal` (3,) the unit normal of its face, on either side.
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
