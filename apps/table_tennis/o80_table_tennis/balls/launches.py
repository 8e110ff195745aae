"""Launches of simulated shots, and the distributions of launches.

`narrow` shots are like the recorded ball gun's, `wide` ones have a much larger spread.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from o80.base.arrays import FloatArray

from ..physics.prediction import predict
from ..world.scene import Vector
from .frame_stamps import FRAME_PERIOD
from .sampled_flight import SampledFlight
from .trajectories import BallTrajectory

DURATION = 1.28
"""Duration of a simulated shot before the cameras: mean of the recorded shots [s]."""


@dataclass(frozen=True, eq=False)
class Launch:
    """State of a ball at its first sighting, which determines the whole flight."""

    position: FloatArray
    """(3,) world frame [m]"""
    velocity: FloatArray
    """(3,) [m/s]"""
    spin: FloatArray
    """(3,) in the axes of the world [rad/s]"""
    name: str = "simulated shot"

    def flight(self, period: float) -> SampledFlight:
        """Returns a flight of one row, the launch; the simulator computes the rest."""
        return SampledFlight(
            name=self.name,
            period=period,
            positions=self.position[None],
            velocities=self.velocity[None],
            bounce_times=np.empty(0),
            residuals=np.zeros(1),
            spins=self.spin[None],
        )

    def seen(self, *, duration: float = DURATION, period: float = FRAME_PERIOD) -> BallTrajectory:
        """Predicts the flight in rows of `period` [s]; by default at the cameras' rate."""
        flight = predict(self.position, self.velocity, duration, spin=self.spin, period=period)
        return BallTrajectory(
            self.name, flight.stamps, flight.positions, flight.velocities, flight.spins
        )


@dataclass(frozen=True)
class NormalLaunches:
    """Normal distribution of position [m], velocity [m/s] and spin [rad/s], nine numbers."""

    mean: tuple[float, ...]
    """(9,)"""
    factor: tuple[tuple[float, ...], ...]
    """(9, 9) lower triangle L of the covariance L L^T; zeros at the end of a row may be omitted."""

    def draw(self, rng: np.random.Generator) -> Launch:
        """Draws a launch."""
        numbers = self._mean + self._factor @ rng.standard_normal(9)
        return Launch(numbers[:3], numbers[3:6], numbers[6:])

    @cached_property
    def _mean(self) -> FloatArray:
        return np.array(self.mean)

    @cached_property
    def _factor(self) -> FloatArray:
        return np.array([[*row, *[0.0] * (9 - len(row))] for row in self.factor])


NARROW = NormalLaunches(
    mean=(0.4592, 2.9540, 1.3696, 0.2371, -4.1304, 2.2861, 64.3667, 1.0882, -3.2837),
    factor=(
        (0.0087,),
        (-0.0015, 0.0117),
        (0.0004, -0.0115, 0.0127),
        (0.0975, 0.0076, 0.0021, 0.0211),
        (-0.0020, 0.0191, -0.0360, -0.0007, 0.0490),
        (-0.0043, -0.0283, 0.1535, -0.0013, -0.0221, 0.0276),
        (-1.0449, 0.8676, -5.1517, -0.8690, -3.2575, 2.2162, 5.4930),
        (1.8194, -1.0130, 2.5388, -1.9186, 0.2045, -1.2435, -1.0031, 5.1595),
        (-2.7453, -0.1803, 1.7132, -0.2434, 0.5993, -0.7898, -0.4311, 1.7903, 4.2418),
    ),
)
"""Launches like the ball gun's: fitted to 40 recorded shots, tested on 40 others, by
studies/fit_launches.py."""


@dataclass(frozen=True)
class UniformLaunches:
    """Uniform distribution: the ball gun's means, and the largest deviation of each number."""

    position: Vector = (0.46, 2.95, 1.37)
    """[m]"""
    position_spread: float = 0.05
    """Along each axis, either way [m]."""
    velocity: Vector = (0.24, -4.14, 2.28)
    """[m/s]"""
    velocity_spread: float = 0.3
    """Along each axis, either way [m/s]."""
    top_spin: tuple[float, float] = (-60.0, 90.0)
    """Range of the spin about x [rad/s]; negative: backspin. There is no side spin."""

    def draw(self, rng: np.random.Generator) -> Launch:
        """Draws a launch."""
        share = rng.uniform(-1.0, 1.0, 7)
        least, most = self.top_spin
        spin = 0.5 * (least + most) + 0.5 * (most - least) * share.item(6)
        return Launch(
            self.position + self.position_spread * share[:3],
            self.velocity + self.velocity_spread * share[3:6],
            np.array([spin, 0.0, 0.0]),
        )


WIDE = UniformLaunches()
"""Launches around the ball gun's, with a much larger spread, and also with backspin."""
