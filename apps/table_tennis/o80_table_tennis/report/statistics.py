"""Rates and lateness of an environment, and results of played episodes."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

import o80
from o80.base.arrays import FloatArray
from o80.hybrid.worlds import Counts
from o80.learning.training import wilson

from ..world.table import TARGET
from .episode_summary import EpisodeSummary


@dataclass
class EpisodeCounts:
    """Counts of an environment while it plays."""

    episodes: int = 0
    seconds: float = 0.0
    """Time in episodes, from the first step to the last, with the caller's time."""
    seconds_stepping: float = 0.0
    """Time in steps, without the caller's time."""
    stalled_episodes: int = 0


@dataclass(frozen=True)
class Statistics:
    """Rates and lateness of an environment since its start."""

    episodes: int
    steps: int
    steps_per_second: float
    """Rate during episodes, with the caller's time, such as its policy's [1/s]."""
    bare_steps_per_second: float
    """Rate without the caller's time, as for a policy that takes no time [1/s]."""
    step_seconds: float
    """Duration of a step in real time [s]."""
    late_actions: int
    """Number of actions that were sent after their iteration and acted at once, or of rows of
    chunks that were skipped."""
    starved_iterations: int
    """Number of the arm's iterations, within episodes, for which no chunk had a row."""
    stalled_episodes: int
    mean_lateness: float
    """Mean number of rows newer than the observed one when a step began; real time only."""
    largest_lateness: int
    """[rows]"""
    arm_iterations: int
    """Number of the arm's iterations."""
    arm_rate: float
    """Iterations of the arm per second of its own clock [1/s]."""
    arm_overruns: int
    arm_skipped: int
    """Number of periods that the arm skipped to catch up."""
    arm_lateness_us: FloatArray = field(repr=False)
    """(T,) lateness of each iteration in the history [us]; real time only."""
    arm_periods_us: FloatArray = field(repr=False)
    """(T - 1,) intervals of rows [us]; real time only."""


def statistics_of(
    counts: EpisodeCounts, of_rig: Counts, arm: o80.Frontend, *, step_seconds: float, rows: int = 1
) -> Statistics:
    """Computes the statistics from counts of environment and rig, and the arm's history.

    rows: number of a chunk's rows in a step of the rig.
    """
    steps, history = of_rig.steps * rows, arm.history()
    seconds = float(history.time[-1] - history.time[0]) * 1e-9
    clocked = slice(0, 0) if arm.bursting else slice(None)
    return Statistics(
        episodes=counts.episodes,
        steps=steps,
        steps_per_second=steps / counts.seconds if counts.seconds else 0.0,
        bare_steps_per_second=steps / counts.seconds_stepping if counts.seconds_stepping else 0.0,
        step_seconds=step_seconds,
        late_actions=of_rig.late_actions,
        starved_iterations=of_rig.starved,
        stalled_episodes=counts.stalled_episodes,
        mean_lateness=of_rig.summed_lateness / max(1, of_rig.steps),
        largest_lateness=of_rig.largest_lateness,
        arm_iterations=int(history.iteration[-1]),
        arm_rate=(len(history) - 1) / seconds if seconds > 0 else 0.0,
        arm_overruns=int(history.overruns[-1]),
        arm_skipped=int(history.skipped[-1]),
        arm_lateness_us=np.asarray(history.lateness[clocked], np.float64) * 1e-3,
        arm_periods_us=np.asarray(np.diff(history.time)[clocked], np.float64) * 1e-3,
    )


@dataclass(frozen=True)
class Played:
    """Episodes of one policy in one environment."""

    episodes: Sequence[EpisodeSummary]
    statistics: Statistics
    seconds: float
    """Time from the first reset to the last step."""

    @property
    def touches(self) -> int:
        """Number of episodes in which the racket touched the ball."""
        return sum(episode.touched for episode in self.episodes)

    @property
    def returns(self) -> int:
        """Number of episodes in which the ball was returned, see `task.outcome`."""
        return sum(episode.returned for episode in self.episodes)

    @property
    def touched(self) -> float:
        """Share of all balls."""
        return self.touches / max(1, len(self.episodes))

    @property
    def returned(self) -> float:
        """Share of all balls."""
        return self.returns / max(1, len(self.episodes))

    @property
    def reward(self) -> float:
        """Mean reward of an episode."""
        return float(np.mean([episode.reward for episode in self.episodes]))

    @property
    def speed(self) -> float:
        """Median of the returned balls' largest speeds after the touch [m/s]; NaN without any."""
        speeds = [episode.speed for episode in self.episodes if episode.returned]
        return float(np.median(speeds)) if speeds else math.nan

    @property
    def miss(self) -> float:
        """Median distance of the returned balls' landings from the target [m]; NaN without any."""
        landings = [each.landing for each in self.episodes if each.returned and each.landing]
        apart = [math.hypot(x - TARGET[0], y - TARGET[1]) for x, y, _ in landings]
        return float(np.median(apart)) if apart else math.nan

    def as_json(self) -> dict[str, Any]:
        """Returns the figures; `returned_95_percent` is Wilson's interval."""
        interval = wilson(self.returns, len(self.episodes))
        return {
            "balls": len(self.episodes),
            "touched": round(self.touched, 4),
            "returned": round(self.returned, 4),
            "returned_95_percent": [round(each, 4) for each in interval],
            "miss": round(self.miss, 3) if self.returns else None,
            "speed": round(self.speed, 2) if self.returns else None,
            "reward": round(self.reward, 4),
            "ends": dict(Counter(episode.end for episode in self.episodes).most_common()),
        }
