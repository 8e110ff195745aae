"""The observation: 22 numbers about the arm and one ball."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Float32Array = NDArray[np.float32]
FloatArray = NDArray[np.float64]

JOINT_POSITIONS = slice(0, 4)
"""[rad]"""
JOINT_VELOCITIES = slice(4, 8)
"""[rad/s]"""
PRESSURES = slice(8, 16)
"""Normalised, agonist and antagonist of each joint."""
BALL_POSITION = slice(16, 19)
"""World frame [m]."""
BALL_VELOCITY = slice(19, 22)
"""World frame [m/s]."""
SIZE = 22


@dataclass(frozen=True)
class ObservationBounds:
    """The box of observations; what lies outside is clipped into it."""

    joint_position: float = math.radians(89.8)
    """Either way [rad]: the limit of the joints."""
    joint_velocity: float = 20.0
    """Either way [rad/s]: the fastest joints recorded reach 3.8."""
    ball_low: tuple[float, float, float] = (-3.0, -3.0, -1.0)
    """[m]"""
    ball_high: tuple[float, float, float] = (3.0, 5.0, 4.0)
    """[m]"""
    ball_velocity: float = 30.0
    """Either way, along each axis [m/s]: a recorded ball comes in at 5."""

    @property
    def low(self) -> Float32Array:
        """(22,), a fresh array."""
        return _row(
            -self.joint_position, -self.joint_velocity, 0.0, self.ball_low, -self.ball_velocity
        )

    @property
    def high(self) -> Float32Array:
        """(22,), a fresh array."""
        return _row(
            self.joint_position, self.joint_velocity, 1.0, self.ball_high, self.ball_velocity
        )

    def clip(self, observation: FloatArray | Float32Array) -> Float32Array:
        """Observations (..., 22) in the box, as 32-bit floats, a fresh array."""
        return np.clip(np.asarray(observation, dtype=np.float32), self.low, self.high)


def pack_observation(
    joint_positions: FloatArray,
    joint_velocities: FloatArray,
    pressures: FloatArray,
    ball_position: FloatArray,
    ball_velocity: FloatArray,
) -> FloatArray:
    """One row (22,), or for balls (N, 3) beside the same arm the rows (N, 22); a fresh array.

    `joint_positions` (4,) [rad], `joint_velocities` (4,) [rad/s], `pressures` (8,) normalised,
    `ball_position` ([N,] 3) [m], `ball_velocity` ([N,] 3) [m/s].
    """
    rows = np.empty((*np.shape(ball_position)[:-1], SIZE))
    rows[..., JOINT_POSITIONS] = joint_positions
    rows[..., JOINT_VELOCITIES] = joint_velocities
    rows[..., PRESSURES] = pressures
    rows[..., BALL_POSITION] = ball_position
    rows[..., BALL_VELOCITY] = ball_velocity
    return rows


def _row(
    joint_position: float,
    joint_velocity: float,
    pressure: float,
    ball_position: tuple[float, float, float],
    ball_velocity: float,
) -> Float32Array:
    return pack_observation(
        np.full(4, joint_position),
        np.full(4, joint_velocity),
        np.full(8, pressure),
        np.array(ball_position),
        np.full(3, ball_velocity),
    ).astype(np.float32)
