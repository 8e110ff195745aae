"""The box of a task's observations."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from o80.base.arrays import Float32Array, FloatArray


class Bounded(Protocol):
    """Anything with bounds: a task, or another observation."""

    @property
    def low(self) -> NDArray[np.float32]:
        """(M,)"""
        ...

    @property
    def high(self) -> NDArray[np.float32]:
        """(M,)"""
        ...


class ObservationBox:
    """Holds the observations of a task within their bounds."""

    def __init__(self, task: Bounded) -> None:
        self.space = spaces.Box(task.low, task.high, task.low.shape, np.float32)
        # compared as 64-bit floats, so that clipping converts only once
        self._low, self._high = task.low.astype(np.float64), task.high.astype(np.float64)

    def clip(self, observations: FloatArray) -> Float32Array:
        """Observations (..., M) in the box, a fresh array."""
        within = np.minimum(np.maximum(observations, self._low), self._high)
        return within.astype(np.float32)
