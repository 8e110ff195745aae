"""How simulated shots start: the launch of one, and the distributions that launches are drawn from.

`narrow` are shots like those of the recorded ball gun, `wide` ones are spread much further.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ..physics.prediction import predict
from ..world.ball import BALL_GUN_SPIN
from ..world.scene import Vector
from .frame_stamps import FRAME_PERIOD
from .sampled_flight import SampledFlight
from .trajectories import BallTrajectory

FloatArray = NDArray[np.float64]

DURATION = 1.28
"""Of a simulated shot as cameras would see it: the mean of the recorded ones [s]."""


@dataclass(frozen=True, eq=False)
class Launch:
    """The state of a ball when it is first seen, which decides its whole flight."""

    position: FloatArray
    """(3,) world frame [m]"""
    velocity: FloatArray
    """(3,) [m/s]"""
    spin: FloatArray
    """(3,) in the axes of the world [rad/s]"""
    name: str = "simulated shot"

    def flight(self, period: float) -> SampledFlight:
        """One row, the launch itself: from there the simulator lets the ball fly by its own law."""
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
        """The predicted flight, in rows every `period` [s]: by default those of the cameras."""
        flight = predict(self.position, self.velocity, duration, spin=self.spin, period=period)
        return BallTrajectory(
            self.name, flight.stamps, flight.positions, flight.velocities, flight.spins
        )


class LaunchDistribution(Protocol):
    """What launches are drawn from."""

    def draw(self, rng: np.random.Generator) -> Launch:
        """Another launch; the same `rng` gives the same one."""
        ...


@dataclass(frozen=True)
class NormalLaunches:
    """Means and standard deviations, each number by itself."""

    position: Vector = (0.46, 2.95, 1.37)
    """[m]"""
    position_deviation: Vector = (0.01, 0.013, 0.016)
    """[m]"""
    velocity: Vector = (0.24, -4.14, 2.28)
    """[m/s]"""
    velocity_deviation: Vector = (0.09, 0.07, 0.17)
    """[m/s]"""
    spin: Vector = BALL_GUN_SPIN
    """[rad/s]"""
    spin_deviation: Vector = (2.0, 3.0, 2.0)
    """[rad/s]"""

    def draw(self, rng: np.random.Generator) -> Launch:
        """Another launch."""
        return Launch(
            rng.normal(self.position, self.position_deviation),
            rng.normal(self.velocity, self.velocity_deviation),
            rng.normal(self.spin, self.spin_deviation),
        )


NARROW = NormalLaunches()
"""Like the recorded shots of the ball gun."""


@dataclass(frozen=True)
class UniformLaunches:
    """Means, and how far each number may lie from its mean, all values alike."""

    position: Vector = NARROW.position
    """[m]"""
    position_spread: float = 0.05
    """Along each axis, either way [m]."""
    velocity: Vector = NARROW.velocity
    """[m/s]"""
    velocity_spread: float = 0.3
    """Along each axis, either way [m/s]."""
    top_spin: tuple[float, float] = (-60.0, 90.0)
    """Least and most spin about x [rad/s]; below 0 it is backspin. There is no side spin."""

    def draw(self, rng: np.random.Generator) -> Launch:
        """Another launch."""
        share = rng.uniform(-1.0, 1.0, 7)
        least, most = self.top_spin
        spin = 0.5 * (least + most) + 0.5 * (most - least) * share.item(6)
        return Launch(
            self.position + self.position_spread * share[:3],
            self.velocity + self.velocity_spread * share[3:6],
            np.array([spin, 0.0, 0.0]),
        )


WIDE = UniformLaunches()
"""Around the ball gun's, much further spread, with backspin too."""
