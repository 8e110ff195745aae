"""Which balls an episode plays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .sampled_flight import SampledFlight
from .sources import Flights

USERS_OWN = -1
"""Number of a ball that is in no source."""


@dataclass(frozen=True)
class DrawnBalls:
    """The played ball, then the extra ones."""

    numbers: list[int]
    """In their source."""
    flights: list[SampledFlight]


def draw_balls(
    source: Flights,
    rng: np.random.Generator,
    *,
    extra: int,
    ball: int | None = None,
    flight: SampledFlight | None = None,
) -> DrawnBalls:
    """One played ball and `extra` others, all different ones if the source has so many.

    The played one is number `ball` of the source, or a `flight` of the caller's own, if given; the
    generator draws as often all the same. Raises IndexError for a number that the source lacks.
    """
    numbers = _drawn(rng, len(source), 1 + extra)
    if ball is not None and ball in numbers:  # then the ball that was drawn flies in its place
        numbers[numbers.index(ball)] = numbers[0]
    others = numbers[1:]
    if flight is not None:
        numbers[0], played = USERS_OWN, flight
    else:
        numbers[0] = numbers[0] if ball is None else int(ball)
        played = source.flight(numbers[0])
    return DrawnBalls(numbers, [played, *(source.flight(number) for number in others)])


def _drawn(rng: np.random.Generator, available: int, wanted: int) -> list[int]:
    """So many numbers below `available`; with repetition only if there are too few."""
    if wanted == 1:
        return [int(rng.integers(available))]
    drawn = rng.choice(available, wanted, replace=wanted > available)
    return [int(number) for number in drawn]
