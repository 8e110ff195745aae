"""Flights of balls for a synthetic camera: thrown over the table, one after the other."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from o80.base.arrays import FloatArray
from o80_devices.cameras.rig import Rig, Table

FLIGHT = 1.1
"""How long a ball is in the air [s]."""
PAUSE = 0.4
"""Between two balls; longer than the tracker takes to forget one [s]."""


@dataclass(frozen=True)
class FlyingBall:
    """A ball at a time."""

    number: int
    """From 1; 0: no ball is in the air, and the rest is meaningless."""
    position: FloatArray
    velocity: FloatArray
    spin: FloatArray


class Throws:
    """Every ball starts above the far end of the table and bounces once on the near half.

    The balls of one seed are the same at the same times, in whatever steps they are asked for.
    """

    def __init__(self, rig: Rig, seed: int = 0) -> None:
        self._law = rig.law()
        self._table = rig.table or Table()
        self._seed = seed

    def at(self, time: float) -> FlyingBall:
        """The ball at a time from the start [s]."""
        index, since = divmod(time, FLIGHT + PAUSE)
        if time < 0 or since > FLIGHT:
            return FlyingBall(0, *np.zeros((3, 3)))
        begin = self.start(int(index) + 1)
        position, velocity, spin, _ = self._law.advance(*begin, since)
        return FlyingBall(int(index) + 1, position, velocity, spin)

    def start(self, number: int) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Position, velocity and spin with which a ball is thrown."""
        random = np.random.default_rng([self._seed, number])
        x, y, z = self._table.middle
        half = self._table.half
        place = np.array([x, y + half[1], z + 0.35]) + random.uniform(-0.1, 0.1, 3)
        velocity = np.array([0.0, -4.2, 1.9]) + random.uniform(-1, 1, 3) * (0.4, 0.3, 0.2)
        spin = random.uniform(-1, 1, 3) * (60.0, 20.0, 20.0)
        return place, velocity, spin
