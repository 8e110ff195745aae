"""The same policy plays the same balls, once as the tracker sees them, once the true ones."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..environment import TableTennisEnvironment
from ..playing import play
from ..report.statistics import Played
from ..settings import Pacing
from .bursting import LockStepTracking, TrueBall, tracked_environment
from .parts import LabSettings
from .player import policy_of, task_of
from .report import BURSTING, REPORT, spread

WANTED = 0.9
"""Returns that the tracked ball should reach, as a share of those on the true ball."""


@dataclass(frozen=True)
class Comparison:
    """Both ways, ball by ball."""

    tracked: Played
    true: Played
    tracking: LockStepTracking

    @property
    def share(self) -> float:
        """Returns on the tracked ball, of those on the true one; NaN without any."""
        return self.tracked.returns / self.true.returns if self.true.returns else float("nan")

    def as_json(self) -> dict[str, Any]:
        """For the report."""
        pairs = [
            (seen.returned, true.returned)
            for seen, true in zip(self.tracked.episodes, self.true.episodes, strict=True)
        ]
        errors, first = np.array(self.tracking.errors), np.array(self.tracking.first_seen)
        return {
            "balls": len(pairs),
            "returned_tracked": self.tracked.returns,
            "returned_true": self.true.returns,
            "returned_both": pairs.count((True, True)),
            "touched_tracked": self.tracked.touches,
            "touched_true": self.true.touches,
            "share": round(self.share, 4),
            "wanted_share": WANTED,
            "reached": bool(self.share >= WANTED),
            "observed_error_mm": spread(1e3 * errors),
            "share_of_observations_with_a_seen_ball": round(
                len(errors) / max(1, self.tracking.observations), 4
            ),
            "first_seen_ms": spread(1e3 * first),
        }


def compare(
    settings: LabSettings,
    *,
    after_each: Callable[[object], None] = lambda _: None,
) -> Comparison:
    """Plays the first balls of the policy's own source both ways."""
    policy = policy_of(settings)
    rig, task = settings.rig.paced(Pacing.INLINE), task_of(settings, policy)
    numbers = range(settings.balls)
    with tracked_environment(rig, task, seed=settings.seed) as (environment, tracking):
        tracked = play(environment, policy, numbers, seed=settings.seed, after_each=after_each)
    with TableTennisEnvironment(rig=rig, task=task) as environment:
        environment.observer.look_through(TrueBall())
        true = play(environment, policy, numbers, seed=settings.seed, after_each=after_each)
    return Comparison(tracked, true, tracking)


def write(comparison: Comparison, folder: Path) -> Path:
    """Puts it into report.json, beside what a lab in real time has written there."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / REPORT
    try:
        report = json.loads(path.read_text())
    except FileNotFoundError:
        report = {}
    report[BURSTING] = comparison.as_json()
    path.write_text(json.dumps(report, indent=2) + "\n")
    return path
