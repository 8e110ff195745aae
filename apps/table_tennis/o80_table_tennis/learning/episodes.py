"""Outcomes of the last episodes of a training."""

from __future__ import annotations

from collections import deque
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

LAST = 1000
"""Episodes that the shares are taken of."""


class EpisodeOutcome(NamedTuple):
    """Outcome of one episode."""

    touched: bool
    returned: bool
    reward: float


class Shares(NamedTuple):
    """Means over episodes; NaN without any."""

    touched: float
    returned: float
    reward: float


def shares(outcomes: Any) -> Shares:
    """Shares of outcomes."""
    table = np.array(outcomes, np.float64).reshape(-1, len(EpisodeOutcome._fields))
    if not len(table):
        return Shares(np.nan, np.nan, np.nan)
    return Shares(*table.mean(axis=0).tolist())


class EpisodeCounter:
    """Follows the episodes of environments that are stepped side by side."""

    def __init__(self, environments: int, *, episodes: int = 0) -> None:
        self.episodes = episodes
        """Ended so far."""
        self._paid = np.zeros(environments)
        self._last: deque[EpisodeOutcome] = deque(maxlen=LAST)

    def step(
        self, rewards: NDArray[Any], dones: NDArray[Any], infos: list[dict[str, Any]]
    ) -> list[tuple[int, EpisodeOutcome]]:
        """The outcomes of a step of all; returns the copies whose episode ended, and how."""
        self._paid += rewards
        ended = [
            (
                copy,
                EpisodeOutcome(
                    bool(infos[copy]["touched"]),
                    bool(infos[copy]["returned"]),
                    float(self._paid[copy]),
                ),
            )
            for copy in np.flatnonzero(dones).tolist()
        ]
        for copy, outcome in ended:
            self._paid[copy] = 0.0
            self._last.append(outcome)
        self.episodes += len(ended)
        return ended

    @property
    def shares(self) -> Shares:
        """Shares of the last episodes."""
        return shares(self._last)
