"""Ball trajectories: recorded or computed, and made ready to be commanded."""

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
"""Rows below which a trajectory cannot be fitted."""


def require_enough_rows(name: str, rows: int) -> None:
    """Raises ValueError if a flight cannot be fitted to so few rows."""
    if rows < SHORTEST:
        raise ValueError(
            f"{name}: {rows} rows are too few to fit a flight, {SHORTEST} are needed; leave it out"
        )


def require_finite(what: str, rows: FloatArray) -> None:
    """Raises ValueError unless all numbers are finite."""
    if not np.isfinite(rows).all():
        raise ValueError(
            f"{what} NaN or infinity (first in row {np.argwhere(~np.isfinite(rows))[0][0]}); "
            "remove the rows in which the ball was not seen"
        )


@dataclass(frozen=True, eq=False)
class BallTrajectory:
    """Where a ball was seen, and when.

    Raises ValueError, naming the trajectory and the cure, unless the arrays fit each other, all
    numbers are finite and the stamps rise.
    """

    name: str
    stamps: FloatArray
    """(N,) [s], rising"""
    positions: FloatArray
    """(N, 3), world frame [m]"""
    velocities: FloatArray
    """(N, 3), world frame [m/s]; of a recording: as the vision system gave them, a rough value"""
    spins: FloatArray | None = None
    """(N, 3) [rad/s], if they are known: a simulated ball"""

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
        """The flight, with its bounces, that explains the positions best."""
        require_enough_rows(self.name, len(self.stamps))
        return fit_flight(self.stamps, self.positions)

    @cached_property
    def replayed(self) -> ReplayedFlights:
        """The same flight by the law of the simulator."""
        return replayed(self.fit, self.stamps, self.positions)

    def resample(self, period: float = PERIOD) -> SampledFlight:
        """The replayed flight in steps of `period` [s], from the first row to the last one fitted.

        The velocities are derivatives of the fit: differences of neighbouring rows, and the
        recorded velocities, are off by 0.2 to 0.9 m/s. The fit is made once and kept.
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
