"""Observation of ball play: 22 numbers of the arm and one ball."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from o80.base.arrays import Float32Array, FloatArray

from ..world.scene import Vector
from .state import State

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
    """Bounds of observations; values outside are clamped."""

    joint_position: float = 1.75
    """Bound either way [rad]: the real arm exceeds its stops, to 1.73 rad in public logs."""
    joint_velocity: float = 40.0
    """Bound either way [rad/s]: simulated joints reach 39 when the muscles are switched fully,
    real ones 8."""
    ball_low: Vector = (-3.0, -3.0, -1.0)
    """[m]"""
    ball_high: Vector = (3.0, 5.0, 4.0)
    """[m]"""
    ball_velocity: float = 30.0
    """Bound of each axis, either way [m/s]: a recorded ball arrives at 5."""

    @property
    def low(self) -> Float32Array:
        """(22,), a fresh array."""
        ball = [*self.ball_low, *[-self.ball_velocity] * 3]
        return self._row(-self.joint_position, -self.joint_velocity, 0.0, ball)

    @property
    def high(self) -> Float32Array:
        """(22,), a fresh array."""
        ball = [*self.ball_high, *[self.ball_velocity] * 3]
        return self._row(self.joint_position, self.joint_velocity, 1.0, ball)

    @staticmethod
    def _row(angle: float, velocity: float, pressure: float, ball: list[float]) -> Float32Array:
        row = [*[angle] * 4, *[velocity] * 4, *[pressure] * 8, *ball]
        return np.array(row, dtype=np.float32)


def observe_ball(state: State) -> FloatArray:
    """Returns observations (..., 22) of arm and ball, a fresh array; not clamped."""
    return np.concatenate((state.motion, state.pressures, state.ball), axis=-1)
