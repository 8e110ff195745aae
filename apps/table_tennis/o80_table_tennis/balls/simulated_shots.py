"""Unlimited simulated shots, each reproduced by its number."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..world.timing import PERIOD
from .launcher_shots import LAUNCHER, LauncherShots
from .launches import NARROW, WIDE, Launch, NormalLaunches, UniformLaunches
from .playable import Verdict, verdict
from .sampled_flight import SampledFlight

LaunchDistribution = NormalLaunches | UniformLaunches | LauncherShots
"""Distribution of launches; the same generator gives the same launches."""
DISTRIBUTIONS: dict[str, LaunchDistribution] = {
    "narrow": NARROW,
    "wide": WIDE,
    "launcher": LAUNCHER,
}
"""Distributions by the names for `TaskSettings.balls`."""
NUMBERS = 2**31
"""Number of shots of a distribution and seed."""
MAX_DRAWS = 1000


def drawn_launch(rng: np.random.Generator, distribution: LaunchDistribution = NARROW) -> Launch:
    """Draws launches until one is playable; the same `rng` gives the same launch.

    Raises ValueError if hardly any launch is playable.
    """
    for _ in range(MAX_DRAWS):
        launch = distribution.draw(rng)
        if (why_not := verdict(launch)) is Verdict.PLAYABLE:
            return launch
    raise ValueError(
        f"none of {MAX_DRAWS} shots of {distribution} can be played (the last one: "
        f"{why_not.value}); choose other means"
    )


@dataclass(frozen=True)
class SimulatedShots:
    """Shots of a distribution and seed, computed from their numbers."""

    distribution: LaunchDistribution = NARROW
    seed: int = 0
    count: int = NUMBERS
    """Number of shots."""
    period: float = PERIOD
    """[s]"""

    def __len__(self) -> int:
        return self.count

    def launch(self, index: int) -> Launch:
        """Returns launch `index`, from 0. Raises IndexError beyond the last."""
        if not 0 <= index < self.count:
            raise IndexError(f"there is no ball {index}: there are 0 to {self.count - 1}")
        return drawn_launch(np.random.default_rng((self.seed, index)), self.distribution)

    def flight(self, index: int) -> SampledFlight:
        """Returns launch `index` as a flight of one row, which a simulator continues."""
        return self.launch(index).flight(self.period)
