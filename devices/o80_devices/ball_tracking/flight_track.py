"""Filters the flight of the ball, and decides whether an unexpected position is a new ball."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from o80.base.arrays import FloatArray
from o80_devices.ball_tracking.ball_filter import GATE, BallFilter
from o80_devices.ball_tracking.ball_row import Reason
from o80_devices.cameras.flight import FlightLaw

NANOSECOND = 1e-9
FASTEST = 20.0
"""Upper limit of a ball's speed [m/s]."""
SLACK = 0.05
"""Tolerance added to the distance that a ball can have travelled [m]."""


def _nothing() -> FloatArray:
    return np.full(3, np.nan)


@dataclass(frozen=True)
class Tracked:
    """State of the ball, or the reason why there is none; numbers are then NaN."""

    time: int
    """[ns]"""
    reason: Reason
    ball: int = 0
    """Number of the ball, from 1; 0: none."""
    position: FloatArray = field(default_factory=_nothing)
    """(3,) filtered [m]."""
    velocity: FloatArray = field(default_factory=_nothing)
    """(3,) [m/s]"""
    spin: FloatArray = field(default_factory=_nothing)
    """(3,) [rad/s]; a large covariance means unknown."""
    covariance: FloatArray = field(default_factory=lambda: np.full((9, 9), np.nan))
    """(9, 9) covariance of position, velocity and spin."""
    measured: FloatArray = field(default_factory=_nothing)
    """(3,) Unfiltered place on which the cameras agree [m]."""
    cameras: int = 0
    """Bit mask of the cameras that agree."""
    residual: float = float("nan")
    """[px]"""

    @property
    def seen(self) -> bool:
        return self.reason == Reason.seen

    @property
    def error(self) -> float:
        """Standard deviation of the position, over all three axes [m]."""
        return float(np.sqrt(np.trace(self.covariance[:3, :3])))

    def fields(self) -> dict[str, Any]:
        """Values that the rows of all trackers have."""
        names = ("ball", "position", "velocity", "spin", "error", "measured")
        values = {name: getattr(self, name) for name in names}
        return values | {"capture_time": self.time if self.seen else 0}


@dataclass(frozen=True)
class Point:
    """Place on which the cameras agree at one time."""

    time: int
    place: FloatArray
    covariance: FloatArray

    def reaches(self, other: Point) -> bool:
        """Whether a ball can have travelled from this point to the other one."""
        way = float(np.linalg.norm(other.place - self.place))
        return way <= FASTEST * (other.time - self.time) * NANOSECOND + SLACK


class FlightTrack:
    """Tracks one ball. Two unexpected positions that agree mean a hit or another ball."""

    def __init__(self, law: FlightLaw, forget: float) -> None:
        self._law = law
        self._longest = forget
        self._filter = BallFilter(law)
        self._last: Point | None = None  # the last sighting of the ball
        self._surprise: Point | None = None
        self._time = 0  # time of the filter [ns]
        self._balls = 0

    @property
    def follows(self) -> bool:
        return self._last is not None

    def forget(self) -> None:
        """Forgets the ball: the next sighting starts a new one."""
        self._last = self._surprise = None

    def expected(self, time: int) -> tuple[FloatArray | None, float]:
        """Predicts the ball's place and standard deviation [m]; None: no ball is tracked."""
        self._predict_to(time)
        if self._last is None:
            return None, 0.0
        spread = float(np.sqrt(np.max(np.diag(self._filter.covariance)[:3])))
        return self._filter.ball[:3], spread

    def lost(self, time: int, reason: Reason) -> Tracked:
        self._predict_to(time)
        return Tracked(time, reason)

    def seen(
        self,
        time: int,
        place: FloatArray,
        covariance: FloatArray,
        cameras: int,
        residual: float,
        *,
        may_surprise: bool,
    ) -> Tracked:
        """Updates the track with the place on which the cameras agree.

        may_surprise: whether enough cameras agree to accept a hit or another ball.
        """
        self._predict_to(time)
        point = Point(time, place, covariance)
        reason = self._take(point, may_surprise)
        if reason != Reason.seen:
            return Tracked(time, reason)
        self._last = point
        position, velocity, spin = self._filter.ball.reshape(3, 3)
        return Tracked(
            time,
            Reason.seen,
            self._balls,
            position,
            velocity,
            spin,
            self._filter.covariance,
            place,
            cameras,
            residual,
        )

    def _take(self, point: Point, may_surprise: bool) -> Reason:
        covariance = point.covariance
        if self._last is None:
            self._balls += 1
            self._filter.begin(point.place, covariance)
            self._surprise = None
            return Reason.seen
        if self._filter.distance(point.place, covariance) <= GATE:
            self._filter.update(point.place, covariance)
            self._surprise = None
            return Reason.seen
        if not may_surprise:
            return Reason.unexpected
        before = self._surprise
        if before is None or before.time >= point.time or not before.reaches(point):
            self._surprise = point
            return Reason.unexpected
        if not self._last.reaches(before):
            self._balls += 1
        self._begin_between(before, point)
        return Reason.seen

    def _begin_between(self, before: Point, point: Point) -> None:
        duration = (point.time - before.time) * NANOSECOND
        velocity = (point.place - before.place) / duration
        variance = float(np.max(np.diag(before.covariance + point.covariance)))
        spread = float(np.sqrt(variance)) / duration + 1.0
        self._filter.begin(point.place, point.covariance, velocity, spread)
        self._surprise = None

    def _predict_to(self, time: int) -> None:
        """Predicts the filter to a time; drops a ball that was not seen for too long."""
        last = self._last
        gone = last is not None and not 0 <= (time - last.time) * NANOSECOND <= self._longest
        if gone:
            self.forget()
        elif last is not None and time > self._time:
            self._filter.predict((time - self._time) * NANOSECOND)
        self._time = time
