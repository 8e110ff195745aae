"""How well a policy plays: episodes with numbered balls, and what came of each."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from o80.learning.training import wilson

from ..balls.sources import balls_from
from ..environment import TableTennisEnvironment
from ..players.conditions import Conditions
from ..players.policies import Policy
from ..playing import play
from ..report.episode_summary import EpisodeSummary
from ..report.statistics import Statistics
from ..settings import Pacing

VERDICT_SEED = 7_000_001
"""Seed of the shots and of the noise of a verdict."""
VERDICT_BALLS = 400


@dataclass(frozen=True)
class Evaluation:
    """Episodes of one policy."""

    name: str
    episodes: Sequence[EpisodeSummary]
    statistics: Statistics
    """Statistics of the environment that played them."""

    @property
    def touched(self) -> float:
        """Share of the balls."""
        return _mean(episode.touched for episode in self.episodes)

    @property
    def returned(self) -> float:
        """Share of the balls."""
        return _mean(episode.returned for episode in self.episodes)

    @property
    def reward(self) -> float:
        """Mean of an episode."""
        return _mean(episode.reward for episode in self.episodes)

    @property
    def ends(self) -> dict[str, int]:
        """How often episodes ended in each way, the most frequent first."""
        return dict(Counter(episode.end for episode in self.episodes).most_common())

    def distance(self, target: Sequence[float]) -> float:
        """Median distance of the returned balls' landings from a target [m]; NaN without any."""
        apart = [
            float(np.hypot(episode.landing[0] - target[0], episode.landing[1] - target[1]))
            for episode in self.episodes
            if episode.returned and episode.landing is not None
        ]
        return float(np.median(apart)) if apart else float("nan")

    @property
    def speed(self) -> float:
        """Median of the largest speeds of the returned balls after the touch [m/s]; NaN without."""
        speeds = [episode.speed for episode in self.episodes if episode.returned]
        return float(np.median(speeds)) if speeds else float("nan")

    @property
    def interval(self) -> tuple[float, float]:
        """Wilson's interval of the share of returned balls, 95 %."""
        return wilson(sum(each.returned for each in self.episodes), len(self.episodes))

    def as_json(self) -> dict[str, Any]:
        """The figures."""
        return {
            "balls": len(self.episodes),
            "touched": round(self.touched, 4),
            "returned": round(self.returned, 4),
            "returned_95_percent": [round(each, 4) for each in self.interval],
            "speed": round(self.speed, 2) if self.returned else None,
            "reward": round(self.reward, 4),
            "ends": self.ends,
        }


def evaluate(
    name: str,
    policy: Policy,
    conditions: Conditions,
    *,
    balls: int | None = VERDICT_BALLS,
    seed: int = VERDICT_SEED,
    pacing: Pacing = Pacing.INLINE,
    after_each: Callable[[EpisodeSummary], None] = lambda _: None,
) -> Evaluation:
    """Plays the first `balls` of the conditions' balls, each once; None: all of a recording."""
    task = conditions.task(ball_seed=seed)
    available = len(balls_from(task.balls, seed))
    count = available if balls is None else min(balls, available)
    with TableTennisEnvironment(rig=conditions.rig(pacing), task=task) as environment:
        played = play(environment, policy, range(count), seed=seed, after_each=after_each)
    return Evaluation(name, played.episodes, played.statistics)


def _mean(values: Any) -> float:
    listed = list(values)
    return float(np.mean(listed)) if listed else float("nan")
