"""Random draws of an episode, in a fixed order: the same generator gives the same episode."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from o80.base.arrays import FloatArray

from .balls.sampled_flight import SampledFlight
from .balls.sources import Flights
from .task.ball_play import ReturnTask

SEEDS = 2**32
USERS_OWN = -1
"""Number of a ball outside of the source."""


@dataclass(frozen=True)
class EpisodeDraw:
    """Random values of an episode."""

    numbers: list[int]
    """Numbers of the balls in their source: the played one, then the extra ones."""
    flights: list[SampledFlight]
    """Flights of these balls."""
    goal: FloatArray
    """(G,) of the task."""
    arm_seed: int
    twin_seed: int


def drawn_episode(
    task: ReturnTask,
    source: Flights,
    rng: np.random.Generator,
    *,
    extra: int = 0,
    ball: int | None = None,
    flight: SampledFlight | None = None,
) -> EpisodeDraw:
    """Draws the played ball and `extra` others, all different if the source has enough balls.

    `ball`, a number of the source, or `flight` replaces the played ball, without a change of the
    number of draws. Raises IndexError for a number that is not in the source.
    """
    count = len(source)
    drawn = rng.choice(count, 1 + extra, replace=extra >= count) if extra else rng.integers(count)
    numbers = np.atleast_1d(drawn).tolist()
    if ball is not None and ball in numbers:  # the drawn ball takes the place of the given one
        numbers[numbers.index(ball)] = numbers[0]
    if ball is not None:
        numbers[0] = int(ball)
    if flight is not None:
        numbers[0] = USERS_OWN
    flights = [flight or source.flight(numbers[0]), *map(source.flight, numbers[1:])]
    goal = task.begin(rng)
    return EpisodeDraw(numbers, flights, goal, int(rng.integers(SEEDS)), int(rng.integers(SEEDS)))
