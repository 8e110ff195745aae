"""Simulates balls thrown over the table, one after the other, for synthetic cameras."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from o80.base.arrays import FloatArray
from o80_devices.cameras.flight import Table
from o80_devices.cameras.rig import Rig

FLIGHT = 1.1
"""Duration of a flight [s]."""
PAUSE = 0.4
"""Time between two balls, longer than the tracker's forget time [s]."""


@dataclass(frozen=True)
class FlyingBall:
    """State of a ball."""

    number: int
    """Number from 1; 0: no ball is in the air, all other fields are meaningless."""
    position: FloatArray
    velocity: FloatArray
    spin: FloatArray


class Throws:
    """Throws balls from above the far end of the table; each bounces once on the near half.

    The state at a time depends on the seed only, not on earlier calls.
    """

    def __init__(self, rig: Rig, seed: int = 0) -> None:
        self._law = rig.law()
        self._table = rig.table or Table()
        self._seed = seed

    def at(self, time: float) -> FlyingBall:
        """Returns the ball at a time since the start [s]."""
        index, since = divmod(time, FLIGHT + PAUSE)
        if time < 0 or since > FLIGHT:
            return FlyingBall(0, *np.zeros((3, 3)))
        ball, _ = self._law.advance(np.concatenate(self.start(int(index) + 1)), since)
        return FlyingBall(int(index) + 1, *ball.reshape(3, 3))

    def start(self, number: int) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Returns initial position, velocity and spin of a ball."""
        random = np.random.default_rng([self._seed, number])
        x, y, z = self._table.middle
        half = self._table.half
        place = np.array([x, y + half[1], z + 0.35]) + random.uniform(-0.1, 0.1, 3)
        velocity = np.array([0.0, -4.2, 1.9]) + random.uniform(-1, 1, 3) * (0.4, 0.3, 0.2)
        spin = random.uniform(-1, 1, 3) * (60.0, 20.0, 20.0)
        return place, velocity, spin
