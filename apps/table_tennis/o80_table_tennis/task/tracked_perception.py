"""The ball as the tracker sees it, instead of the true one: what the policy of the lab observes.

The ball of the newest row of the tracker flies on, by the laws of flight and bounce, from the time
of its images to that of the arm's last row. A row is used once; without a new one the ball counts
as not seen, and the filter of the observation predicts it. Until the tracker has seen the ball of
an episode, the mean launch is a guess in its place.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

import o80
from o80.base.arrays import FloatArray
from o80_devices.ball_tracking.ball_row import Reason

from ..balls.launches import WIDE
from ..physics.prediction import STATE, flight_nodes
from .perception import Perceived, Perception
from .state import State

STEP = 0.005
"""Time step of the predicted flight from image to row [s]."""
OLDEST = 0.15
"""Older than this a ball does not count as seen [s]."""
KNOWN_VELOCITY = 0.25
"""Above this standard deviation the velocity of a ball is not known yet: the tracker has seen it
once or twice [m/s]."""


class TrackedPerception(Perception):
    """Perception by the tracker, of one episode after the other.

    `tracker` is an observer of its segment, or None while there is none; `now` the time of the row
    that is observed, on the clock of the images [ns].
    """

    def __init__(self, tracker: Callable[[], o80.Frontend | None], now: Callable[[], int]) -> None:
        self._tracker, self._now = tracker, now
        self._used, self._seen_yet = 0, False
        self.ball: FloatArray = np.zeros(6)
        """Ball that was perceived last, also as a guess."""
        self.at = 0
        """Time of the row of the arm at which that was [ns]."""
        self.ball_time = 0
        """Time of the images of the ball that was perceived last [ns]; 0: it was not seen."""

    def begin(self, state: State, _generators: object, _which: object) -> Perceived:
        """The ball has just begun to fly: no image shows it yet."""
        self._used, self._seen_yet = self._now(), False
        self.ball = np.array([*WIDE.position, *WIDE.velocity])
        return self._perceived(state, None)

    def perceive(self, state: State, _which: object = None) -> Perceived:
        """The ball at the time of the arm's last row, if there is a new image of it."""
        tracker = self._tracker()
        row = None if tracker is None else tracker.latest().extended
        return self._perceived(state, row)

    def _perceived(self, state: State, row: Any) -> Perceived:
        """By a row of the tracker."""
        self.at, self.ball_time = self._now(), 0
        if row is None or not self._is_new(row):
            return Perceived(self.ball[np.newaxis], np.array([True]), state.pressures)
        self._used = self.ball_time = int(row.capture_time)
        late = max(0.0, (self.at - self.ball_time) * 1e-9)
        self.ball = flight_nodes(row.position, row.velocity, row.spin, late, step=STEP)[-1, STATE]
        first, self._seen_yet = not self._seen_yet, True
        return Perceived(self.ball[np.newaxis], np.array([False]), state.pressures, first)

    def _is_new(self, row: Any) -> bool:
        """Whether it shows a ball that was not used yet."""
        old = int(row.capture_time) <= max(self._used, self.at - round(OLDEST * 1e9))
        unknown = np.max(np.diag(row.covariance)[3:6]) > KNOWN_VELOCITY**2
        return bool(row.reason == Reason.seen and not old and not unknown)
