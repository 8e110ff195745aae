"""Predicts flights of a ball that bounces on the table."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from o80.base.arrays import FloatArray
from o80_mujoco.balls import predicted_flight

from ..world.ball import NO_SPIN
from ..world.table import TABLE, Table
from .aerodynamics import AERODYNAMICS, AIR
from .impact import platform
from .interpolation import along_path

Numbers = Sequence[float] | FloatArray

STEP = 0.02
"""Step of the integration [s]; the error over a second of flight stays below 10 um."""
TIME, STATE, SPIN, BOUNCED = 0, slice(1, 7), slice(7, 10), 10
"""Columns of `flight_nodes`: [s]; position [m], velocity [m/s]; spin [rad/s]; 1 after a bounce."""


@dataclass(frozen=True, eq=False)
class PredictedFlight:
    """Predicted states of a ball, in equal steps."""

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


def predict(
    position: Numbers,
    velocity: Numbers,
    duration: float,
    *,
    spin: Numbers = NO_SPIN,
    period: float = 0.01,
    table: Table | None = TABLE,
) -> PredictedFlight:
    """Predicts a flight from `position` [m], `velocity` [m/s] and `spin` [rad/s], each (3,).

    Rows are every `period` [s] from 0 to `duration` [s]; the ball bounces on `table`, if any.
    """
    for name, value in (("duration", duration), ("period", period)):
        if not (math.isfinite(value) and value > 0):
            raise ValueError(f"{name} must be a positive number of seconds, got {value}")
    nodes = flight_nodes(position, velocity, spin, duration, table)
    starts = nodes[:, TIME]
    times = period * np.arange(math.floor(duration / period + 1e-9) + 1, dtype=np.float64)
    positions, velocities = along_path(times, nodes[:, STATE], starts)
    last = np.searchsorted(starts, times, side="right") - 1
    decayed = np.exp(-AERODYNAMICS.spin_decay * (times - starts[last]))
    spins = nodes[last, SPIN] * decayed[:, None]
    return PredictedFlight(times, positions, velocities, starts[nodes[:, BOUNCED] == 1.0], spins)


def flight_nodes(
    position: Numbers,
    velocity: Numbers,
    spin: Numbers,
    duration: float,
    table: Table | None = TABLE,
    *,
    step: float = STEP,
) -> FloatArray:
    """Integrates a flight to states (K, 11), every `step` [s]: `TIME`, `STATE`, `SPIN`, `BOUNCED`.

    A bounce gives two states of the same time, before and after; the second one is marked.
    """
    ball = np.concatenate((position, velocity, spin), dtype=np.float64)
    if not np.isfinite(ball).all():
        raise ValueError(f"position {position} and velocity {velocity} must be finite")
    on = None if table is None else platform(table)
    return predicted_flight(ball, AIR, on, duration, step)
