"""What has happened to a ball in an episode, or to many balls in theirs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Numbers = float | NDArray[np.float64]
Flags = bool | NDArray[np.bool_]
Vectors = Sequence[float] | NDArray[np.float64]


@dataclass(slots=True)
class BallRecord:
    """Since the episode began. Of one ball: Python numbers; of many: arrays, shapes (...)."""

    smallest_distance: Numbers
    """Of the surfaces of ball and racket so far [m]."""
    touched: Flags = False
    """The racket has touched the ball."""
    velocity_after: Vectors = (0.0, 0.0, 0.0)
    """(..., 3) of the ball after that touch [m/s]."""
    largest_speed: Numbers = 0.0
    """Of the ball since that touch [m/s]."""
    landed: Flags = False
    """The ball has touched the table after the touch; bounces before it do not count."""
    landing: Vectors = (0.0, 0.0, 0.0)
    """(..., 3) where it did, if it did [m]."""
    touched_net: Flags = False
    touched_floor: Flags = False

    @property
    def flew_back(self) -> Any:
        """(...) whether the racket has touched the ball, and the ball left towards the opponent."""
        return np.logical_and(self.touched, np.asarray(self.velocity_after)[..., 1] > 0)

    def at(self, index: Any) -> BallRecord:
        """The records of some of many balls, by an index or a mask."""
        return BallRecord(*(np.asarray(getattr(self, name))[index] for name in self.__slots__))
