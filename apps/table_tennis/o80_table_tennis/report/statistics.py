"""Rates and lateness of an environment, and episodes that were played."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from o80.base.arrays import FloatArray

from ..rig.rig import Rig
from .episode_summary import EpisodeSummary


@dataclass
class EpisodeCounts:
    """Counts of an environment while it plays."""

    episodes: int = 0
    seconds: float = 0.0
    """In episodes, from the first step to the last, the caller's own time included."""
    seconds_stepping: float = 0.0
    """In steps, the caller's own time left out."""
    stalled_episodes: int = 0


@dataclass(frozen=True)
class Statistics:
    """Rates and lateness since an environment was made."""

    episodes: int
    steps: int
    exact_steps: int
    """Steps of exactly five iterations of the arm and five of every twin, by their numbers."""
    steps_per_second: float
    """While an episode was played, the caller's own time (its policy) included [1/s]."""
    bare_steps_per_second: float
    """Without the caller's own time, as for a policy that needs no time [1/s]."""
    step_seconds: float
    """How long a step takes in real time [s]."""
    late_actions: int
    """Actions that came after the iteration for which they were meant, and acted at once; rows of
    chunks that were skipped instead."""
    starved_iterations: int
    """Iterations of the arm, within episodes, for which no chunk had a row."""
    stalled_episodes: int
    mean_lateness: float
    """Lateness of a step's end: newest row of the arm less the one used [rows]; real time only."""
    largest_lateness: int
    """[rows]"""
    arm_iterations: int
    """All that the arm has made."""
    arm_rate: float
    """Iterations of the arm a second of its own clock [1/s]."""
    arm_overruns: int
    arm_skipped: int
    """Periods that the arm left out to catch up."""
    arm_lateness_us: FloatArray = field(repr=False)
    """(T,) how late each iteration began, as far back as the history goes [us]; real time only."""
    arm_periods_us: FloatArray = field(repr=False)
    """(T - 1,) between the times of neighbouring rows [us]; real time only."""


def statistics_of(counts: EpisodeCounts, rig: Rig) -> Statistics:
    """From the counts of an environment and of its rig, and the history of the arm."""
    arm, steps = rig.arm.frontend, rig.counts
    rows = arm.history()
    seconds = float(rows.time[-1] - rows.time[0]) * 1e-9
    lateness: FloatArray = np.empty(0)
    periods: FloatArray = np.empty(0)
    if not arm.bursting:
        lateness = np.asarray(rows.lateness, np.float64) * 1e-3
        periods = np.asarray(np.diff(rows.time), np.float64) * 1e-3
    return Statistics(
        episodes=counts.episodes,
        steps=steps.steps,
        exact_steps=steps.exact_steps,
        steps_per_second=steps.steps / counts.seconds if counts.seconds > 0 else 0.0,
        bare_steps_per_second=(
            steps.steps / counts.seconds_stepping if counts.seconds_stepping > 0 else 0.0
        ),
        step_seconds=rig.settings.step,
        late_actions=steps.late_actions,
        starved_iterations=steps.starved_iterations,
        stalled_episodes=counts.stalled_episodes,
        mean_lateness=steps.summed_lateness / max(1, steps.steps),
        largest_lateness=steps.largest_lateness,
        arm_iterations=int(rows.iteration[-1]),
        arm_rate=(len(rows) - 1) / seconds if seconds > 0 else 0.0,
        arm_overruns=int(rows.overruns[-1]),
        arm_skipped=int(rows.skipped[-1]),
        arm_lateness_us=lateness,
        arm_periods_us=periods,
    )


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
