"""Predicted flights of a ball that bounces on the table."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..world.ball import NO_SPIN
from ..world.scene import Vector
from ..world.table import TABLE, Table
from .aerodynamics import AERODYNAMICS, Aerodynamics, State, Turn, runge_kutta_step
from .impact import bounced
from .interpolation import along_path

FloatArray = NDArray[np.float64]
Numbers = Sequence[float] | FloatArray

STEP = 0.02
"""Step of the integration [s]; the error over a second of flight stays below 10 um."""
SHORTEST_STEP = 1e-9
"""A shorter rest of a flight is ignored [s]."""


@dataclass(frozen=True, eq=False)
class PredictedFlight:
    """Where a ball will be, in equal steps."""

    stamps: FloatArray
    """(N,) since the start [s]"""
    positions: FloatArray
    """(N, 3), world frame [m]"""
    velocities: FloatArray
    """(N, 3), world frame [m/s]"""
    bounce_times: FloatArray
    """(bounces,) since the start [s]"""
    spins: FloatArray
    """(N, 3), in the axes of the world [rad/s]"""


@dataclass(frozen=True)
class Crossing:
    """When and how a ball goes through a plane."""

    time: float
    """Since the start of the prediction [s]."""
    position: FloatArray
    """(3,) [m]"""
    velocity: FloatArray
    """(3,) [m/s]"""


@dataclass(frozen=True)
class _Node:
    time: float
    state: State[float]
    spin: Vector
    after_bounce: bool = False


def predict(
    position: Numbers,
    velocity: Numbers,
    duration: float,
    *,
    spin: Numbers = NO_SPIN,
    period: float = 0.01,
    aerodynamics: Aerodynamics = AERODYNAMICS,
    table: Table | None = TABLE,
) -> PredictedFlight:
    """The flight from `position` (3,) [m], `velocity` (3,) [m/s], `spin` (3,) [rad/s], world frame.

    Rows every `period` [s] from 0 to `duration` [s]; the ball bounces on `table` if there is one.
    """
    _require_positive(duration=duration, period=period)
    nodes = list(_nodes(position, velocity, spin, duration, aerodynamics, table))
    times = period * np.arange(math.floor(duration / period + 1e-9) + 1, dtype=np.float64)
    positions, velocities = along_path(
        times, np.array([node.state for node in nodes]), np.array([node.time for node in nodes])
    )
    bounces = np.array([node.time for node in nodes if node.after_bounce])
    starts = np.array([node.time for node in nodes])
    last = np.searchsorted(starts, times, side="right") - 1
    decayed = np.exp(-aerodynamics.spin_decay * (times - starts[last]))
    spins = np.array([node.spin for node in nodes])[last] * decayed[:, None]
    return PredictedFlight(times, positions, velocities, bounces, spins)


def predict_crossing(
    position: Numbers,
    velocity: Numbers,
    *,
    axis: int,
    at: float,
    duration: float = 2.0,
    spin: Numbers = NO_SPIN,
    aerodynamics: Aerodynamics = AERODYNAMICS,
    table: Table | None = TABLE,
) -> Crossing | None:
    """When the coordinate `axis` (0 x, 1 y, 2 z) first becomes `at` [m]; None if not in time.

    A ball that starts on the plane crosses it when it comes back.
    """
    nodes = _nodes(position, velocity, spin, duration, aerodynamics, table)
    for left, right in pairwise(nodes):
        before, after = left.state[axis] - at, right.state[axis] - at
        if before * after < 0 or (after == 0 and before != 0):
            return _crossing(left, right, axis, at)
    return None


def predict_landing(
    position: Numbers,
    velocity: Numbers,
    *,
    duration: float = 2.0,
    spin: Numbers = NO_SPIN,
    aerodynamics: Aerodynamics = AERODYNAMICS,
    table: Table = TABLE,
) -> Crossing | None:
    """The first touch of the table, with the velocity before it; None if the ball misses it."""
    nodes = _nodes(position, velocity, spin, duration, aerodynamics, table)
    for touching, node in pairwise(nodes):
        if node.after_bounce:
            state = np.array(touching.state)
            return Crossing(time=touching.time, position=state[:3], velocity=state[3:])
    return None


def _nodes(
    position: Numbers,
    velocity: Numbers,
    spin: Numbers,
    duration: float,
    aerodynamics: Aerodynamics,
    table: Table | None,
) -> Iterator[_Node]:
    """The states along the flight; a bounce gives two of the same time, before and after."""
    state = _start(position, velocity)
    wx, wy, wz = (float(value) for value in spin)
    now = 0.0
    yield _Node(now, state, (wx, wy, wz))
    while duration - now > SHORTEST_STEP:
        dt = min(STEP, duration - now)
        # the spin halfway through the step => the turn of the velocity
        halfway = math.exp(-aerodynamics.spin_decay * dt / 2)
        share = aerodynamics.magnus * halfway
        turn = (share * wx, share * wy, share * wz)
        halved_at = aerodynamics.halved_at(halfway * math.sqrt(wx * wx + wy * wy + wz * wz))
        drag, gravity = aerodynamics.drag, aerodynamics.gravity
        fly = partial(_flown, state, turn, drag, gravity, halved_at)

        # a touch of the table ends the step early
        touch = None if table is None else _touch(state, fly, dt, table)
        dt = dt if touch is None else touch
        state, now = fly(dt), now + dt
        decay = math.exp(-aerodynamics.spin_decay * dt)
        wx, wy, wz = decay * wx, decay * wy, decay * wz
        yield _Node(now, state, (wx, wy, wz))
        if touch is not None and table is not None:
            state, (wx, wy, wz) = bounced(state, (wx, wy, wz), table)
            yield _Node(now, state, (wx, wy, wz), after_bounce=True)


def _flown(
    state: State[float],
    turn: Turn[float],
    drag: float,
    gravity: float,
    halved_at: float,
    dt: float,
) -> State[float]:
    return runge_kutta_step(state, turn, drag, gravity, dt, halved_at)


def _start(position: Numbers, velocity: Numbers) -> State[float]:
    x, y, z = (float(value) for value in position)
    vx, vy, vz = (float(value) for value in velocity)
    if not all(math.isfinite(value) for value in (x, y, z, vx, vy, vz)):
        raise ValueError(f"position {position} and velocity {velocity} must be finite")
    return (x, y, z, vx, vy, vz)


def _touch(
    state: State[float], fly: Callable[[float], State[float]], dt: float, table: Table
) -> float | None:
    """Time [s] within `dt` at which the falling ball touches the table; None if it does not."""
    height = table.bounce_height
    # a rising ball is above where it started at least until it has gone half the way to its apex
    low = min(dt, max(0.0, state[5] * 0.05))
    high = dt
    if fly(low)[2] < height or fly(high)[2] >= height:
        return None
    for _ in range(40):
        middle = (low + high) / 2
        low, high = (middle, high) if fly(middle)[2] >= height else (low, middle)
    touching = fly(high)
    return high if table.carries(touching[0], touching[1]) else None


def _crossing(left: _Node, right: _Node, axis: int, at: float) -> Crossing:
    nodes, times = np.array([left.state, right.state]), np.array([left.time, right.time])
    low, high = left.time, right.time
    rising = right.state[axis] > left.state[axis]
    for _ in range(40):
        middle = (low + high) / 2
        position, _velocity = along_path(np.array([middle]), nodes, times)
        beyond = (position[0, axis] > at) == rising
        low, high = (low, middle) if beyond else (middle, high)
    position, velocity = along_path(np.array([high]), nodes, times)
    return Crossing(time=high, position=position[0], velocity=velocity[0])


def _require_positive(**values: float) -> None:
    for name, value in values.items():
        if not (math.isfinite(value) and value > 0):
            raise ValueError(f"{name} must be a positive number of seconds, not {value}")
