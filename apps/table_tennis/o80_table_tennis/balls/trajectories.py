"""Ball trajectories: recorded or computed, and made ready to be commanded."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .flight_fit import FlightFit, fit_flight

FloatArray = NDArray[np.float64]

SHORTEST = 8
"""Rows below which a trajectory cannot be fitted."""


def require_enough_rows(name: str, rows: int) -> None:
    """Raises ValueError if a flight cannot be fitted to so few rows."""
    if rows < SHORTEST:
        raise ValueError(
            f"{name}: {rows} rows are too few to fit a flight, {SHORTEST} are needed; leave it out"
        )


@dataclass(frozen=True)
class SampledFlight:
    """A flight in equal steps, ready to be commanded: row i is at i * period after the start."""

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

    @property
    def residual(self) -> float:
        """Root mean square of the distances of the recorded rows from the fit [m]."""
        return float(np.sqrt(np.mean(self.residuals**2)))

    @property
    def duration(self) -> float:
        """From the first row to the last [s]."""
        return (len(self.positions) - 1) * self.period


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

    def __post_init__(self) -> None:
        rows = len(self.stamps)
        for what, array, shape in (
            ("stamps", self.stamps, (rows,)),
            ("positions", self.positions, (rows, 3)),
            ("velocities", self.velocities, (rows, 3)),
        ):
            if array.shape != shape:
                raise ValueError(f"{self.name}: {what} have shape {array.shape}, not {shape}")
            if not np.isfinite(array).all():
                row = int(np.argwhere(~np.isfinite(array))[0][0])
                raise ValueError(
                    f"{self.name}: {what} hold NaN or infinity (first in row {row}); "
                    "remove the rows in which the ball was not seen"
                )
        falling = np.flatnonzero(np.diff(self.stamps) <= 0)
        if len(falling):
            raise ValueError(
                f"{self.name}: the time stamps do not rise from row {falling[0]} to the next; "
                "sort the rows by time and remove repeated ones"
            )

    @property
    def duration(self) -> float:
        """From the first row to the last [s]."""
        return float(self.stamps[-1] - self.stamps[0])

    def named(self, name: str) -> BallTrajectory:
        """The same trajectory under another name."""
        return replace(self, name=name)

    @cached_property
    def fit(self) -> FlightFit:
        """The flight, with its bounces, that explains the positions best."""
        require_enough_rows(self.name, len(self.stamps))
        return fit_flight(self.stamps, self.positions)

    def resample(self, period: float = 0.002) -> SampledFlight:
        """The fitted flight in steps of `period` [s], from the first row to the last one fitted.

        The velocities are derivatives of the fit: differences of neighbouring rows, and the
        recorded velocities, are off by 0.2 to 0.9 m/s. The fit is made once and kept.
        """
        if not (np.isfinite(period) and period > 0):
            raise ValueError(f"period must be a positive number of seconds, not {period}")
        fit = self.fit
        count = int(np.floor((fit.end - fit.start) / period + 1e-6)) + 1
        times = fit.start + np.arange(count, dtype=np.float64) * period
        positions, velocities = fit.at(times)
        return SampledFlight(
            name=self.name,
            period=period,
            positions=positions,
            velocities=velocities,
            bounce_times=fit.bounce_times - fit.start,
            residuals=fit.residuals,
        )


def load_trajectories(
    path: str | Path,
    *,
    frame_offset: Sequence[float] | None = None,
    frame_yaw: float | None = None,
) -> list[BallTrajectory]:
    """The trajectories of a file, or of all files of a folder, in the order of their names.

    Read are JSON files of a ball gun (`.json`, time stamps reconstructed), HDF5 files of shots
    (`.hdf5`, `.h5`). The world frame is the rows turned by `frame_yaw` [rad] about z, then shifted
    by `frame_offset` (3,) [m]; where None, what is known for the format.

    Raises FileNotFoundError or ValueError, naming the file and the cure.
    """
    from .recordings import read_recording, recording_files

    return [
        trajectory
        for file in recording_files(Path(path))
        for trajectory in read_recording(file, frame_offset=frame_offset, frame_yaw=frame_yaw)
    ]
