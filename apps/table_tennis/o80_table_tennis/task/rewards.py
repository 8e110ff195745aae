"""Rewards of the tasks with a ball.

The published rule pays at the end: without a hit, minus the smallest distance of ball and racket;
after a hit, by how near to the target the ball landed. Landing is the first touch of the table
after the hit.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..world.scene import Vector
from ..world.table import TARGET
from .ball_record import BallRecord, Numbers

FloatArray = NDArray[np.float64]

# of math, not of NumPy, which differ in the last bit: one episode and many get the same rewards
_power = np.frompyfunc(math.pow, 2, 1)
_hypot = np.frompyfunc(math.hypot, 2, 1)


@dataclass(frozen=True)
class RewardRule:
    """The numbers of the published configuration."""

    target: Vector = TARGET
    """Where the ball should land [m]."""
    reach: float = 3.0
    """A landing this far from the target is worth 0 [m]."""
    exponent: float = 0.75
    floor: float = -0.2
    """The least a touched ball is worth."""

    def distance(self, landing: Any, target: Any) -> FloatArray:
        """(...) of landings (..., 2+) from targets (..., 2+), in the plane of the table [m]."""
        apart = np.asarray(landing)[..., :2] - np.asarray(target)[..., :2]
        return np.asarray(_hypot(apart[..., 0], apart[..., 1]), dtype=np.float64)

    def landing_term(self, distance: Numbers) -> FloatArray:
        """max(1 - (d / reach)^exponent, floor), for distances d (...) from the target [m]."""
        share = np.asarray(_power(np.asarray(distance) / self.reach, self.exponent), np.float64)
        return np.maximum(1.0 - share, self.floor)

    def returned(self, record: BallRecord, target: Any) -> FloatArray:
        """(...) rewards of balls that should land on the target."""
        term = self.landing_term(self.distance(record.landing, target))
        return self._paid(record, term)

    def smashed(self, record: BallRecord, target: Any) -> FloatArray:
        """(...) the same times the largest speed of the ball after the touch [m/s]."""
        term = self.landing_term(self.distance(record.landing, target))
        return self._paid(record, np.maximum(term * record.largest_speed, self.floor))

    def touched(self, record: BallRecord) -> FloatArray:
        """(...) 1 for a touched ball, else minus the smallest distance [m]."""
        return np.where(record.touched, 1.0, -np.asarray(record.smallest_distance))

    def _paid(self, record: BallRecord, landing: FloatArray) -> FloatArray:
        touched = np.where(record.landed, landing, self.floor)
        return np.where(record.touched, touched, -np.asarray(record.smallest_distance))
