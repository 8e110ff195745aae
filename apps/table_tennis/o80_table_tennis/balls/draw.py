"""Which balls an episode plays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .sampled_flight import SampledFlight
from .sources import CachedFlights

USERS_OWN = -1
"""Number of a ball that is in no source."""


@dataclass(frozen=True)
class DrawnBalls:
    """The played ball, then the extra ones."""

    numbers: list[int]
    """In their source."""
    flights: list[SampledFlight]


NO_BALLS = DrawnBalls([USERS_OWN], [])


def draw_balls(
    source: CachedFlights,
    rng: np.random.Generator,
    *,
    extra: int,
    ball: int | None = None,
    flight: SampledFlight | None = None,
) -> DrawnBalls:
    """One played ball and `extra` others, with replacement.

    The played one is number `ball` of the source, or a `flight` of the caller's own, if given; the
    generator draws as often all the same. Raises IndexError for a number that the source lacks.
    """
    numbers = [int(number) for number in rng.integers(len(source), size=1 + extra)]
    others = numbers[1:]
    if flight is not None:
        numbers[0], played = USERS_OWN, flight
    else:
        numbers[0] = numbers[0] if ball is None else int(ball)
        played = source.flight(numbers[0])
    return DrawnBalls(numbers, [played, *(source.flight(number) for number in others)])
