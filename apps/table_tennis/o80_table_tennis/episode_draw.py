"""Random draws for an episode, in a fixed order: the same generator, the same episode."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from o80.base.arrays import FloatArray

from .balls.draw import DrawnBalls, draw_balls
from .balls.sources import Flights
from .task.task import Task

SEEDS = 2**32


@dataclass(frozen=True)
class EpisodeDraw:
    """All that is random in an episode."""

    balls: DrawnBalls
    goal: FloatArray
    """(G,) of the task."""
    arm_seed: int
    twin_seed: int


def drawn_episode(
    task: Task,
    balls: Flights,
    rng: np.random.Generator,
    *,
    extra: int = 0,
    options: Mapping[str, Any],
) -> EpisodeDraw:
    """An episode drawn from `rng`, with `options` of `reset`."""
    drawn = draw_balls(balls, rng, extra=extra, **options)
    goal = task.begin(rng)
    return EpisodeDraw(drawn, goal, int(rng.integers(SEEDS)), int(rng.integers(SEEDS)))
