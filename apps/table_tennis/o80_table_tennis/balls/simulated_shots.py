"""Shots without any file: as many as one likes, each with a number that brings it back."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..world.timing import PERIOD
from .launcher_shots import LAUNCHER, LauncherShots
from .launches import NARROW, WIDE, Launch, NormalLaunches, UniformLaunches
from .playable import Verdict, verdict
from .sampled_flight import SampledFlight

LaunchDistribution = NormalLaunches | UniformLaunches | LauncherShots
"""Distribution that launches are drawn from: the same generator gives the same ones."""
DISTRIBUTIONS: dict[str, LaunchDistribution] = {
    "narrow": NARROW,
    "wide": WIDE,
    "launcher": LAUNCHER,
}
"""By the names that `TaskSettings.balls` takes."""
NUMBERS = 2**31
"""How many shots there are of a distribution and a seed."""
MAX_DRAWS = 1000


def drawn_launch(rng: np.random.Generator, distribution: LaunchDistribution = NARROW) -> Launch:
    """The first launch drawn from `rng` that can be played; the same `rng`, the same launch.

    Raises ValueError if the distribution hardly has any.
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
    """The shots of a distribution and a seed, by their numbers; nothing is kept."""

    distribution: LaunchDistribution = NARROW
    seed: int = 0
    count: int = NUMBERS
    """How many there are."""
    period: float = PERIOD
    """[s]"""

    def __len__(self) -> int:
        return self.count

    def launch(self, index: int) -> Launch:
        """Launch `index`, from 0. Raises IndexError beyond the last."""
        if not 0 <= index < self.count:
            raise IndexError(f"there is no ball {index}: there are 0 to {self.count - 1}")
        return drawn_launch(np.random.default_rng((self.seed, index)), self.distribution)

    def flight(self, index: int) -> SampledFlight:
        """The launch `index`, from which a simulator lets the ball fly."""
        return self.launch(index).flight(self.period)
