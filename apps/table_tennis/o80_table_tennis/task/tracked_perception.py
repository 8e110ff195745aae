"""Perception of the lab: the tracker's ball instead of the true one.

The ball of the tracker's newest row is predicted, by the laws of flight and bounce, from the time
of its images to the time of the arm's last row. A row is used once; without a new row the ball
counts as not seen, and the observation's filter predicts it. Before the first sighting of an
episode, the mean launch is the guess.
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
"""Largest age of a seen ball [s]."""
KNOWN_VELOCITY = 0.25
"""Largest standard deviation of a known velocity: it is larger after the tracker's first one or two
sightings [m/s]."""


class TrackedPerception(Perception):
    """Perception of one episode after the other through the tracker.

    `tracker` returns a frontend of its segment, or None while there is none; `now` returns the time
    of the observed row, on the images' clock [ns].
    """

    def __init__(self, tracker: Callable[[], o80.Frontend | None], now: Callable[[], int]) -> None:
        self._tracker, self._now = tracker, now
        self._used, self._was_seen = 0, False
        self.ball: FloatArray = np.zeros(6)
        """Last perceived or guessed ball."""
        self.at = 0
        """Time of the arm's row of that perception [ns]."""
        self.ball_time = 0
        """Time of the last perceived ball's images [ns]; 0: not seen."""

    def begin(self, state: State, _generators: object, _which: object) -> Perceived:
        """Returns the guess for a ball that no image shows yet."""
        self._used, self._was_seen = self._now(), False
        self.ball = np.array([*WIDE.position, *WIDE.velocity])
        return self._perceived(state, None)

    def perceive(self, state: State, _which: object = None) -> Perceived:
        """Returns the ball at the time of the arm's last row, seen if the tracker has a new row."""
        tracker = self._tracker()
        row = None if tracker is None else tracker.latest().extended
        return self._perceived(state, row)

    def _perceived(self, state: State, row: Any) -> Perceived:
        """Returns the perception for a row of the tracker, or None."""
        self.at, self.ball_time = self._now(), 0
        if row is None or not self._is_new(row):
            return Perceived(self.ball[np.newaxis], np.array([True]), state.pressures)
        self._used = self.ball_time = int(row.capture_time)
        late = max(0.0, (self.at - self.ball_time) * 1e-9)
        self.ball = flight_nodes(row.position, row.velocity, row.spin, late, step=STEP)[-1, STATE]
        first, self._was_seen = not self._was_seen, True
        return Perceived(self.ball[np.newaxis], np.array([False]), state.pressures, first)

    def _is_new(self, row: Any) -> bool:
        """Whether a row has an unused, recent ball with known velocity."""
        old = int(row.capture_time) <= max(self._used, self.at - round(OLDEST * 1e9))
        unknown = np.max(np.diag(row.covariance)[3:6]) > KNOWN_VELOCITY**2
        return bool(row.reason == Reason.seen and not old and not unknown)
