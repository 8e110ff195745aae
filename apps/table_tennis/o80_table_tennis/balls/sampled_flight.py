"""A flight in equal steps, as replayed by the twins."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from o80.base.arrays import FloatArray

from ..world.ball import BALL_GUN_SPIN


@dataclass(frozen=True)
class SampledFlight:
    """Flight in equal steps, ready to be commanded: row i is at i * period after the start."""

    name: str
    period: float
    """[s]"""
    positions: FloatArray
    """(T, 3), world frame [m]"""
    velocities: FloatArray
    """(T, 3), world frame [m/s]"""
    bounce_times: FloatArray
    """(bounces,), since the first row [s]"""
    residuals: FloatArray
    """(N,) distance of each recorded row from the fit [m]"""
    spins: FloatArray | None = None
    """(T, 3), in the axes of the world [rad/s]; None: the ball gun's spin in every row"""

    @property
    def states(self) -> FloatArray:
        """Returns positions, velocities and spins (T, 9), a fresh array."""
        spins = self.spins
        if spins is None:
            spins = np.broadcast_to(BALL_GUN_SPIN, self.positions.shape)
        return np.concatenate((self.positions, self.velocities, spins), axis=1)

    @property
    def residual(self) -> float:
        """Root mean square distance of the recorded rows from the fit [m]."""
        return float(np.sqrt(np.mean(self.residuals**2)))
