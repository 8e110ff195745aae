"""State of arm and ball after a step, for tasks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from o80.base.arrays import FloatArray

from ..world.arm import JOINTS
from .ball_record import BallRecord


@dataclass(slots=True)
class State:
    """State of one episode, or of N: then every array has a first dimension of N.

    The arrays may be views of memory that the next step overwrites.
    """

    steps: int | NDArray[np.int64]
    """(...) number of steps of the episode so far."""
    motion: FloatArray
    """(..., 8) angles [rad], then velocities [rad/s] of the joints."""
    pressures: FloatArray
    """(..., 8) pressures in the muscles, normalised."""
    asked: FloatArray
    """(..., 8) commanded pressures, normalised; with dead time they may not act yet."""
    racket: FloatArray
    """(..., 3) centre of the racket, world frame [m]."""
    ball: FloatArray
    """(..., 6) position [m], then velocity [m/s] of the ball, world frame."""
    record: BallRecord
    """Record of the ball's contacts."""
    goal: FloatArray
    """(..., G) goal of the episode, chosen by the task."""

    @property
    def joint_positions(self) -> FloatArray:
        """(..., 4) [rad]"""
        return self.motion[..., :JOINTS]

    @property
    def joint_velocities(self) -> FloatArray:
        """(..., 4) [rad/s]"""
        return self.motion[..., JOINTS:]

    def at(self, index: Any) -> State:
        """Selects some of N episodes by an index or a mask (N,); one of them as views."""
        if isinstance(index, np.ndarray) and index.size == 1 and index.dtype != np.bool_:
            index = slice(int(index[0]), int(index[0]) + 1)
        names = [name for name in self.__slots__ if name not in ("steps", "record")]
        arrays = {name: getattr(self, name)[index] for name in names}
        return State(np.asarray(self.steps)[index], record=self.record.at(index), **arrays)
