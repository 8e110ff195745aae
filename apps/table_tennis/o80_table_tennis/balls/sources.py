"""Sources of the episodes' balls: recorded files, or simulated shots."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, partial
from pathlib import Path

from ..world.timing import PERIOD
from .flight_cache import cached_flight
from .recordings import load_trajectories, recording_files
from .sampled_flight import SampledFlight
from .simulated_shots import DISTRIBUTIONS, NUMBERS, SimulatedShots
from .trajectories import BallTrajectory


class KeptFlights:
    """Flights that are read or fitted on first access, and cached."""

    def __init__(self, shots: list[Callable[[], SampledFlight]]):
        if not shots:
            raise ValueError("no balls: give a file or folder that holds at least one shot")
        self._shots = shots
        self._kept: dict[int, SampledFlight] = {}

    def __len__(self) -> int:
        return len(self._shots)

    def flight(self, index: int) -> SampledFlight:
        """Returns flight `index`, from 0. Raises IndexError beyond the last."""
        if not 0 <= index < len(self):
            raise IndexError(f"there is no ball {index}: there are 0 to {len(self) - 1}")
        if index not in self._kept:
            self._kept[index] = self._shots[index]()
        return self._kept[index]


Flights = KeptFlights | SimulatedShots
"""Balls by their numbers, from 0."""


def recorded_balls(path: str | Path, *, period: float = PERIOD) -> KeptFlights:
    """Returns the shots of a file, or of all recordings of a folder, sorted by name.

    A file of one shot (JSON) is read on first access, a file of many (HDF5) at once. Fitted
    flights are also cached in files, see `flight_cache`.
    """
    shots: list[Callable[[], SampledFlight]] = []
    for file in recording_files(Path(path)):
        if file.suffix == ".json":
            shots.append(partial(_of_file, file, period))
        else:
            shots += [partial(_of_shot, shot, period) for shot in load_trajectories(file)]
    return KeptFlights(shots)


def _of_file(file: Path, period: float) -> SampledFlight:
    """Reads the flight of a one-shot file; cached, because reconstructing time stamps is slow."""
    content = file.read_bytes()
    return cached_flight(
        content, file.stem, period, lambda: load_trajectories(file)[0].resample(period)
    )


def _of_shot(shot: BallTrajectory, period: float) -> SampledFlight:
    content = shot.stamps.tobytes() + shot.positions.tobytes()
    return cached_flight(content, shot.name, period, lambda: shot.resample(period))


@cache
def balls_from(
    balls: str | None, seed: int = 0, period: float = PERIOD, count: int | None = None
) -> Flights:
    """Returns simulated shots, "narrow" (also for None), "wide" or "launcher", or a path's shots.

    `seed`, `count`: of simulated shots; None: unlimited. Instances are shared in
    this process. Raises FileNotFoundError or ValueError for a wrong path or count.
    """
    name = balls or "narrow"
    if name in DISTRIBUTIONS:
        return SimulatedShots(DISTRIBUTIONS[name], seed, count or NUMBERS, period)
    if count is not None:
        raise ValueError(f"ball_count={count} is for simulated shots; {balls} is a recording")
    return recorded_balls(name, period=period)
