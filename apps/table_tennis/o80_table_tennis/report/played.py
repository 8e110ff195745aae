"""Episodes that were played, for reports."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from .episode_summary import EpisodeSummary
from .statistics import Statistics


@dataclass(frozen=True)
class Played:
    """Episodes of one environment."""

    episodes: Sequence[EpisodeSummary]
    statistics: Statistics
    seconds: float
    """From the first reset to the last step."""

    @property
    def returns(self) -> int:
        """Episodes in which the ball was returned, see `task.outcome`."""
        return sum(episode.returned for episode in self.episodes)

    @property
    def touches(self) -> int:
        """Episodes in which the racket met the ball."""
        return sum(episode.touched for episode in self.episodes)
