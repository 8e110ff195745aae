"""The laws of flight and bounce for estimates: of one ball in Python's numbers, or of many at once.

Each function takes and returns numbers, or arrays of one shape with an entry for each ball; the
arithmetic is the same, so that one ball and many get the same bits. A ball spins about x only: top
spin above 0, backspin below. The laws are those of `aerodynamics` and `impact`; tests compare them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from ..world.ball import BALL_RADIUS
from ..world.table import TABLE
from .aerodynamics import AERODYNAMICS
from .impact import SPIN_PER_VELOCITY

Number = Any
"""A float, or an array of floats."""


class Maths(NamedTuple):
    """What differs between numbers and arrays."""

    sqrt: Callable[[Number], Number]
    minimum: Callable[[Number, Number], Number]
    maximum: Callable[[Number, Number], Number]


NUMBERS = Maths(math.sqrt, min, max)
ARRAYS = Maths(np.sqrt, np.minimum, np.maximum)


Ball = tuple[Number, ...]
"""Seven numbers: position x, y, z [m], velocity [m/s] and top spin [rad/s]."""
Crossing = tuple[Number, Number, Number, Number, Number, Number]
"""Of a plane y = const: where, x and z [m], velocity [m/s], and the time until then [s]."""
Three = tuple[Number, Number, Number]

_DRAG, _GRAVITY = AERODYNAMICS.drag, AERODYNAMICS.gravity
_MAGNUS, _HALVED = AERODYNAMICS.magnus, AERODYNAMICS.halved_at(1.0)
_SPIN_DECAY = AERODYNAMICS.spin_decay
_GRIP = 1.0 - TABLE.tangential_restitution
_HEIGHT = TABLE.bounce_height
_TINY = 1e-9


def acceleration(vx: Number, vy: Number, vz: Number, spin: Number, maths: Maths) -> Three:
    """Of drag, lift and gravity [m/s^2]."""
    speed = maths.sqrt(vx * vx + vy * vy + vz * vz)
    turn = _MAGNUS * spin * speed / (speed + _HALVED * abs(spin) + _TINY)
    slowing = _DRAG * speed
    return (-slowing * vx, -turn * vz - slowing * vy, turn * vy - slowing * vz - _GRAVITY)


def advanced(ball: Ball, step: float, maths: Maths) -> Ball:
    """After a `step` [s] of free flight, by the forces in its middle."""
    x, y, z, vx, vy, vz, spin = ball
    ax, ay, az = acceleration(vx, vy, vz - 0.5 * step * _GRAVITY, spin, maths)
    return (
        x + step * (vx + 0.5 * step * ax),
        y + step * (vy + 0.5 * step * ay),
        z + step * (vz + 0.5 * step * az),
        vx + step * ax,
        vy + step * ay,
        vz + step * az,
        (1.0 - _SPIN_DECAY * step) * spin,
    )


def rebounded(ball: Ball, maths: Maths) -> Ball:
    """A ball at the table after its touch."""
    x, y, z, vx, vy, vz, spin = ball
    falling = abs(vz)
    rebound = TABLE.normal_restitution * falling
    taken_x, taken_y = _GRIP * vx, _GRIP * (vy + BALL_RADIUS * spin)
    taken = maths.sqrt(taken_x * taken_x + taken_y * taken_y) + _TINY
    share = maths.minimum(1.0, TABLE.friction * (falling + rebound) / taken)
    return (
        x,
        y,
        z,
        vx - share * taken_x,
        vy - share * taken_y,
        rebound,
        spin - SPIN_PER_VELOCITY * share * taken_y,
    )


def rebounded_within(step: float, ball: Ball, maths: Maths) -> Ball:
    """A ball that has come below the table in the last `step` [s]: as if it had touched it."""
    x, y, z, vx, vy, vz, spin = ball
    since = maths.maximum((_HEIGHT - z) / maths.maximum(-vz, _TINY), 0.0)
    since = maths.minimum(since, step)
    lost = since * _GRAVITY
    _, _, _, wx, wy, wz, spin = rebounded((x, y, z, vx, vy, vz + lost, spin), maths)
    return (
        x + since * (wx - vx),
        y + since * (wy - vy),
        _HEIGHT + since * wz,
        wx,
        wy,
        wz - lost,
        spin,
    )


def at_table(ball: Ball, maths: Maths) -> tuple[Ball, Number]:
    """A ball that comes down on the table, after its touch there, and the time until then [s]."""
    _, _, z, vx, vy, vz, spin = ball
    ax, ay, az = acceleration(vx, vy, vz, spin, maths)
    fall = maths.maximum(z - _HEIGHT, 0.0)
    falling = maths.maximum(-az, 1.0)  # however wrong the estimate of the spin is
    time = (vz + maths.sqrt(vz * vz + 2.0 * falling * fall)) / falling
    x, y, z, vx, vy, vz, spin = _flown(ball, (ax, ay, az), time, maths)
    # the forces have changed on the way
    above, speed = z - _HEIGHT, maths.maximum(-vz, 0.5)
    root = maths.sqrt(maths.maximum(speed * speed + 2.0 * _GRAVITY * above, 0.0))
    late = 2.0 * above / (speed + root)
    z = _HEIGHT + 0.0 * late  # an array if the others are
    touching = (x + late * vx, y + late * vy, z, vx, vy, vz - late * _GRAVITY, spin)
    return rebounded(touching, maths), time + late


def at_plane(ball: Ball, plane: float, maths: Maths) -> Crossing:
    """Where a ball that comes nearer, without a touch of the table, goes through y = `plane`."""
    _, y, _, vx, vy, vz, spin = ball
    ax, ay, az = acceleration(vx, vy, vz, spin, maths)
    way, speed = y - plane, maths.maximum(-vy, 0.5)
    root = maths.sqrt(maths.maximum(speed * speed - 2.0 * ay * way, 0.0))
    time = 2.0 * way / (speed + root)
    x, y, z, vx, vy, vz, _ = _flown(ball, (ax, ay, az), time, maths)
    late = (y - plane) / maths.maximum(-vy, 0.5)
    return (x + late * vx, z + late * vz, vx, vy, vz - late * _GRAVITY, time + late)


def _flown(ball: Ball, begin: Three, time: Number, maths: Maths) -> Ball:
    """After `time` [s] of free flight; `begin` is the acceleration now."""
    x, y, z, vx, vy, vz, spin = ball
    ax, ay, az = begin
    half, kept = 0.5 * time, 1.0 - 0.5 * _SPIN_DECAY * time
    spin = spin * kept
    mx, my, mz = acceleration(vx + half * ax, vy + half * ay, vz + half * az, spin, maths)
    spin = spin * kept
    ex, ey, ez = acceleration(vx + time * mx, vy + time * my, vz + time * mz, spin, maths)
    sixth = time / 6.0
    return (
        x + time * (vx + sixth * (ax + 2.0 * mx)),
        y + time * (vy + sixth * (ay + 2.0 * my)),
        z + time * (vz + sixth * (az + 2.0 * mz)),
        vx + sixth * (ax + 4.0 * mx + ex),
        vy + sixth * (ay + 4.0 * my + ey),
        vz + sixth * (az + 4.0 * mz + ez),
        spin,
    )
