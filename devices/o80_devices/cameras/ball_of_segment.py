"""Reads the ball of another segment, for example a simulated world, at given times."""

from __future__ import annotations

from collections import deque
from typing import Any

import numpy as np

import o80
from o80_devices.attached import Attached
from o80_devices.cameras.throws import FlyingBall

KEPT = 32
"""Number of stored pairs of a row and its time."""
GAP = 3.0
"""Longest time before a row with a known time, in multiples of KEPT periods."""


class BallOfSegment:
    """Reads the ball of a segment at given times, between two rows.

    field: path of the ball in a row, such as "observed.balls": a record with position and
    velocity; of several records, the first one.
    times: segment whose rows map rows of the first one to times: `world_row` (iteration) and
    `arm_time` [ns]. Without it, the times of the rows count.
    """

    def __init__(self, segment: str, field: str, times: str) -> None:
        self._ball = Attached(segment)
        self._times = Attached(times) if times else None
        self._path = field.split(".")
        self._pairs: deque[tuple[int, int]] = deque(maxlen=KEPT)
        self._read = -1
        """Iteration of the last row that was searched for a pair."""

    def at(self, time: int, now: int) -> FlyingBall | None:
        """Returns the ball at a time [ns]; None if no rows cover that. now: current time [ns]."""
        frontend, is_new = self._ball.frontend(now)
        if is_new:
            self._pairs.clear()
        if frontend is None:
            return None
        if self._times is None:
            newest = frontend.latest()
            period = round(frontend.period * 1e9)
            return self._between(frontend, newest.iteration, newest.time, time, period)
        self._read_pairs(now)
        for row, when in self._pairs:
            if when >= time:
                return self._between(frontend, row, when, time, round(frontend.period * 1e9))
        return None

    def _read_pairs(self, now: int) -> None:
        assert self._times is not None
        frontend, is_new = self._times.frontend(now)
        if is_new:
            self._pairs.clear()
            self._read = -1
        if frontend is None or frontend.published == self._read:
            return
        rows = frontend.history(min(KEPT, frontend.published - self._read))
        for i in np.flatnonzero(rows.iteration > self._read):
            row, when = int(rows.extended.world_row[i]), int(rows.extended.arm_time[i])
            if row >= 0 and (not self._pairs or when > self._pairs[-1][1]):
                self._pairs.append((row, when))
        self._read = int(rows.iteration[-1])

    def _between(
        self, frontend: o80.Frontend, row: int, when: int, time: int, period: int
    ) -> FlyingBall | None:
        """Interpolates the ball at `time`, before `when`, the time of a row."""
        back, rest = divmod(when - time, period)
        if not 0 <= back < KEPT * GAP:
            return None
        first = row - back - (1 if rest else 0)
        try:
            rows = frontend.history(since=first, until=row - back)
        except o80.Error:
            return None
        if len(rows) == 0 or int(rows.iteration[0]) != first:
            return None
        balls = self._balls(rows)
        share = 1.0 - rest / period if rest else 0.0
        later = balls[-1]
        position = (1 - share) * balls[0]["position"] + share * later["position"]
        velocity = (1 - share) * balls[0]["velocity"] + share * later["velocity"]
        spin = later["spin"] if "spin" in (later.dtype.names or ()) else np.zeros(3)
        return FlyingBall(1, position, velocity, np.array(spin))

    def _balls(self, rows: o80.History) -> Any:
        """Returns the record of the ball in each row (rows,)."""
        values: Any = rows.rows
        for name in self._path:
            values = values[name]
        return values.reshape(len(rows), -1)[:, 0]

    def close(self) -> None:
        self._ball.close()
        if self._times is not None:
            self._times.close()
