"""When an episode ends, and what it was worth.

The published rule pays at the end: without a hit, minus the smallest distance of ball and racket;
after a hit, by how near to the target the ball landed. Landing is the first touch of the table
after the hit.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum


@dataclass(frozen=True)
class BallRecord:
    """What has happened to one ball since the episode began."""

    smallest_distance: float
    """Of the surfaces of ball and racket so far [m]."""
    y: float
    """Where the ball is now [m]; the arm stands at 0, the opponent at 2.9."""
    hit: bool = False
    """The racket has touched the ball."""
    landing: tuple[float, float] | None = None
    """x, y of the first touch of the table after the hit [m]."""
    touched_net: bool = False
    touched_floor: bool = False
    largest_speed: float = 0.0
    """Of the ball after the hit [m/s]."""

    def __post_init__(self) -> None:
        if self.landing is not None and not self.hit:
            raise ValueError("a landing needs a hit: a touch of the table before it is a bounce")


class End(Enum):
    """Why an episode ended."""

    RUNNING = "running"
    LANDED = "landed"
    NET = "net"
    FLOOR = "floor"
    PASSED = "passed"
    """The ball has passed the arm."""
    OUT_OF_STEPS = "out of steps"

    @property
    def terminated(self) -> bool:
        """Ended by what happened to the ball."""
        return self not in (End.RUNNING, End.OUT_OF_STEPS)

    @property
    def truncated(self) -> bool:
        """Ended by the number of steps."""
        return self is End.OUT_OF_STEPS


@dataclass(frozen=True)
class EndRule:
    """The limits of an episode."""

    passed_y: float = -0.8
    """A ball nearer to the wall behind the arm than this has passed it [m]."""
    most_steps: int = 300
    """Steps of the environment after which an episode is truncated."""

    def judge(self, ball: BallRecord, steps: int) -> End:
        """The first reason that holds after `steps` steps; bounces before the hit are none."""
        if ball.landing is not None:
            return End.LANDED
        if ball.touched_net:
            return End.NET
        if ball.touched_floor:
            return End.FLOOR
        if ball.y < self.passed_y:
            return End.PASSED
        return End.OUT_OF_STEPS if steps >= self.most_steps else End.RUNNING


@dataclass(frozen=True)
class RewardRule:
    """What an ended episode pays; the numbers of the published configuration."""

    target: tuple[float, float, float] = (0.0, 2.5, 0.78)
    """Where the ball should land [m]."""
    reach: float = 3.0
    """A landing this far from the target is worth nothing [m]."""
    exponent: float = 0.75
    floor: float = -0.2
    """The least a hit is worth."""
    smash: bool = False
    """The hit term times the largest speed of the ball after the hit."""

    def distance(self, landing: tuple[float, float]) -> float:
        """Of a landing from the target, in the plane of the table [m]."""
        return math.dist(landing, self.target[:2])

    def landing_term(self, distance: float) -> float:
        """max(1 - (d / reach)^exponent, floor), for `distance` d from the target [m]."""
        return max(1.0 - math.pow(distance / self.reach, self.exponent), self.floor)

    def reward(self, ball: BallRecord) -> float:
        """The reward of an episode that ended like this; it is paid once, at the end."""
        if not ball.hit:
            return -ball.smallest_distance
        if ball.landing is None:
            return self.floor
        term = self.landing_term(self.distance(ball.landing))
        return max(term * ball.largest_speed, self.floor) if self.smash else term
