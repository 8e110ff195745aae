"""Record of what has happened to a ball in an episode, or to many balls in theirs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Numbers = float | NDArray[np.float64]
Flags = bool | NDArray[np.bool_]
Vectors = Sequence[float] | NDArray[np.float64]

NOWHERE = (0.0, 0.0, 0.0)


@dataclass(slots=True)
class BallRecord:
    """Since the episode began. Of one ball: Python numbers; of many: arrays, shapes (...)."""

    smallest_distance: Numbers
    """Smallest distance of the surfaces of ball and racket so far [m]."""
    touched: Flags = False
    """The racket has touched the ball."""
    velocity_after: Vectors = NOWHERE
    """(..., 3) of the ball after that touch [m/s]."""
    largest_speed: Numbers = 0.0
    """Largest speed of the ball since that touch [m/s]."""
    landed: Flags = False
    """The ball has touched the table after the touch; bounces before it do not count."""
    landing: Vectors = NOWHERE
    """(..., 3) where it did, if it did [m]."""
    touched_net: Flags = False
    """The ball has touched the net, and not the table between racket and net."""
    touched_floor: Flags = False
    net_position: Vectors = NOWHERE
    """(..., 3) where it touched the net after the touch of the racket, if it did [m]."""
    floor_position: Vectors = NOWHERE
    """(..., 3) of the floor alike [m]."""

    def at(self, index: Any) -> BallRecord:
        """The records of some of many balls, by an index or a mask."""
        return BallRecord(*(np.asarray(getattr(self, name))[index] for name in self.__slots__))
