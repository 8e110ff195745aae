"""Where the balls of the episodes come from: recorded files, or simulated shots."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, partial
from pathlib import Path

import numpy as np

from ..world.timing import PERIOD
from .recordings import load_trajectories, recording_files
from .sampled_flight import SampledFlight
from .simulated_shots import simulated_shot
from .trajectories import BallTrajectory

SIMULATED_SHOTS = 80
"""How many different shots there are without any file."""


class CachedFlights:
    """Flights that are read or computed when first asked for, and kept.

    `shots` computes the trajectory of each number.
    """

    def __init__(self, shots: list[Callable[[], BallTrajectory]], *, period: float = PERIOD):
        if not shots:
            raise ValueError("no balls: give a file or folder that holds at least one shot")
        self._shots = shots
        self._period = period
        self._kept: dict[int, SampledFlight] = {}

    def __len__(self) -> int:
        return len(self._shots)

    def flight(self, index: int) -> SampledFlight:
        """Flight `index`, from 0. Raises IndexError beyond the last."""
        if not 0 <= index < len(self):
            raise IndexError(f"there is no ball {index}: there are 0 to {len(self) - 1}")
        if index not in self._kept:
            self._kept[index] = self._shots[index]().resample(self._period)
        return self._kept[index]


def recorded_balls(path: str | Path, *, period: float = PERIOD) -> CachedFlights:
    """The shots of a file, or of all recordings of a folder in the order of their names.

    A file of one shot (JSON) is read when the shot is asked for, one of many (HDF5) at once.
    """
    shots: list[Callable[[], BallTrajectory]] = []
    for file in recording_files(Path(path)):
        if file.suffix == ".json":
            shots.append(partial(_only_shot, file))
        else:
            shots += [partial(_same, shot) for shot in load_trajectories(file)]
    return CachedFlights(shots, period=period)


def simulated_balls(
    *, count: int = SIMULATED_SHOTS, seed: int = 0, period: float = PERIOD
) -> CachedFlights:
    """Shots of a ball gun with drag, top spin and one bounce; the same `seed`, the same shots."""
    return CachedFlights(
        [
            partial(lambda rng_seed: simulated_shot(np.random.default_rng(rng_seed)), (seed, i))
            for i in range(count)
        ],
        period=period,
    )


@cache
def balls_from(path: str | None, seed: int = 0, period: float = PERIOD) -> CachedFlights:
    """Recorded balls of `path`, or simulated ones if there is none; shared in this process."""
    if path is None:
        return simulated_balls(seed=seed, period=period)
    return recorded_balls(path, period=period)


def _only_shot(file: Path) -> BallTrajectory:
    return load_trajectories(file)[0]


def _same(shot: BallTrajectory) -> BallTrajectory:
    return shot
