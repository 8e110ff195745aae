"""Ball trajectories: recorded or computed, and resampled for commands."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from o80.base.arrays import FloatArray

from ..world.timing import PERIOD
from .flight_fit import FlightFit, fit_flight
from .replayed_flight import ReplayedFlights, replayed
from .sampled_flight import SampledFlight

SHORTEST = 8
"""Least number of rows to fit a trajectory."""


def require_enough_rows(name: str, rows: int) -> None:
    """Raises ValueError for too few rows to fit a flight."""
    if rows < SHORTEST:
        raise ValueError(
            f"{name}: {rows} rows are too few to fit a flight, {SHORTEST} are needed; leave it out"
        )


def require_finite(what: str, rows: FloatArray) -> None:
    """Raises ValueError for numbers that are not finite."""
    if not np.isfinite(rows).all():
        raise ValueError(
            f"{what} NaN or infinity (first in row {np.argwhere(~np.isfinite(rows))[0][0]}); "
            "remove the rows in which the ball was not seen"
        )


@dataclass(frozen=True, eq=False)
class BallTrajectory:
    """Seen positions of a ball, with time stamps.

    Raises ValueError, naming the trajectory and the cure, unless the shapes agree, all
    numbers are finite and the stamps rise.
    """

    name: str
    stamps: FloatArray
    """(N,) [s], rising"""
    positions: FloatArray
    """(N, 3), world frame [m]"""
    velocities: FloatArray
    """(N, 3), world frame [m/s]; of a recording: rough values of the vision system"""
    spins: FloatArray | None = None
    """(N, 3) [rad/s], known for a simulated ball only"""

    def __post_init__(self) -> None:
        rows = len(self.stamps)
        for what, array, shape in (
            ("stamps", self.stamps, (rows,)),
            ("positions", self.positions, (rows, 3)),
            ("velocities", self.velocities, (rows, 3)),
        ):
            if array.shape != shape:
                raise ValueError(f"{self.name}: {what} have shape {array.shape}, not {shape}")
            require_finite(f"{self.name}: {what} hold", array)
        falling = np.flatnonzero(np.diff(self.stamps) <= 0)
        if len(falling):
            raise ValueError(
                f"{self.name}: the time stamps do not rise from row {falling[0]} to the next; "
                "sort the rows by time and remove repeated ones"
            )

    @cached_property
    def fit(self) -> FlightFit:
        """Flights and bounces fitted to the positions."""
        require_enough_rows(self.name, len(self.stamps))
        return fit_flight(self.stamps, self.positions)

    @cached_property
    def replayed(self) -> ReplayedFlights:
        """Flights fitted with the simulator's law."""
        return replayed(self.fit, self.stamps, self.positions)

    def resample(self, period: float = PERIOD) -> SampledFlight:
        """Samples the replayed flight each `period` [s], from the first to the last fitted row.

        The velocities are derivatives of the fit: differences of neighbouring rows, and the
        recorded velocities, are wrong by 0.2 to 0.9 m/s. The fit is cached.
        """
        if not (np.isfinite(period) and period > 0):
            raise ValueError(f"period must be a positive number of seconds, got {period}")
        fit = self.fit
        count = int(np.floor((fit.end - fit.start) / period + 1e-6)) + 1
        times = fit.start + np.arange(count, dtype=np.float64) * period
        positions, velocities, spins = self.replayed.at(times)
        return SampledFlight(
            name=self.name,
            period=period,
            positions=positions,
            velocities=velocities,
            bounce_times=fit.bounce_times - fit.start,
            residuals=self.replayed.residuals,
            spins=spins,
        )
