"""Record of a ball's contacts in an episode, or of many balls in many episodes."""

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
    """Contacts since the episode began. One ball: Python numbers; many: arrays, shapes (...)."""

    smallest_distance: Numbers
    """Smallest distance between the surfaces of ball and racket so far [m]."""
    touched: Flags = False
    """Whether the racket has touched the ball."""
    velocity_after: Vectors = NOWHERE
    """(..., 3) velocity of the ball after the touch [m/s]."""
    largest_speed: Numbers = 0.0
    """Largest speed of the ball since the touch [m/s]."""
    landed: Flags = False
    """Whether the ball has touched the table after the touch; earlier bounces do not count."""
    landing: Vectors = NOWHERE
    """(..., 3) place of the landing, if any [m]."""
    touched_net: Flags = False
    """Whether the ball has touched the net, without touching the table between racket and net."""
    touched_floor: Flags = False
    net_position: Vectors = NOWHERE
    """(..., 3) place of the contact with the net after the touch, if any [m]."""
    floor_position: Vectors = NOWHERE
    """(..., 3) place of the contact with the floor after the touch, if any [m]."""

    def at(self, index: Any) -> BallRecord:
        """Selects the records of some balls by an index or a mask."""
        return BallRecord(*(np.asarray(getattr(self, name))[index] for name in self.__slots__))
