"""An estimate of a flying ball from noisy measurements: position, velocity and top spin.

After each measurement the estimate is the last one flown on for a step, by the laws of flight and
bounce, plus gain times what the measurement adds (`filter_gains`). Where the ball was not seen, the
estimate flies on alone. A velocity that no flight and no bounce explains (a racket has met the
ball) makes the filter begin anew. One ball and many get the same bits.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..world.table import TABLE
from .filter_gains import FilterSettings, gains
from .tracked_ball import (
    ARRAYS,
    NUMBERS,
    Ball,
    Crossing,
    Number,
    advanced,
    at_plane,
    at_table,
    rebounded_within,
)

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.int64]

NEAR_TABLE = TABLE.bounce_height + 0.1
"""A ball that rises from below this height has bounced [m]."""
UNEXPLAINED = 2.0
"""A velocity along an axis that is off by more than this begins a new flight [m/s]."""
SLOWEST = 0.5
"""A ball that comes nearer more slowly than this has no crossing [m/s]."""
NO_CROSSING: Crossing = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)

EVERY = slice(None)
Six = Sequence[Number]


def corrected(ball: Ball, seen: Six, gain: Sequence[Number]) -> Ball:
    """The estimate after a measurement (6), position and velocity."""
    x, y, z, vx, vy, vz, spin = ball
    dx, dy, dz = seen[0] - x, seen[1] - y, seen[2] - z
    du, dv, dw = seen[3] - vx, seen[4] - vy, seen[5] - vz
    g = gain
    return (
        x + (g[0] * dx + g[1] * du),
        y + (g[4] * dy + g[5] * dz + g[6] * dv + g[7] * dw),
        z + (g[8] * dy + g[9] * dz + g[10] * dv + g[11] * dw),
        vx + (g[2] * dx + g[3] * du),
        vy + (g[12] * dy + g[13] * dz + g[14] * dv + g[15] * dw),
        vz + (g[16] * dy + g[17] * dz + g[18] * dv + g[19] * dw),
        spin + (g[20] * dy + g[21] * dz + g[22] * dv + g[23] * dw),
    )


class OneBallFilter:
    """The estimate of one ball, in Python's numbers: ten times as fast as arrays of one entry."""

    def __init__(self, settings: FilterSettings) -> None:
        table = gains(settings)
        self._before, self._after = table.before.tolist(), table.after.tolist()
        self._mean_spin, self._step = settings.mean_spin, settings.step
        self.begin((0.0,) * 6)

    def begin(self, seen: Sequence[float]) -> None:
        """A new flight, with its first measurement (6)."""
        x, y, z, vx, vy, vz = seen
        self.ball: Ball = (x, y, z, vx, vy, vz, self._mean_spin)
        self._bounced, self._count = False, 0

    def step(self, seen: Sequence[float] | None) -> None:
        """A step later, with a measurement (6), or with none."""
        ball = advanced(self.ball, self._step, NUMBERS)
        if not self._bounced and self._touches(ball, seen):
            ball = rebounded_within(self._step, ball, NUMBERS)
            self._bounced, self._count = True, -1
        if seen is None:
            self.ball = ball
            return
        if (
            abs(seen[3] - ball[3]) > UNEXPLAINED
            or abs(seen[4] - ball[4]) > UNEXPLAINED
            or abs(seen[5] - ball[5]) > UNEXPLAINED
        ):
            self.begin(seen)
            return
        self._count += 1
        table = self._after if self._bounced else self._before
        self.ball = corrected(ball, seen, table[min(self._count, len(table) - 1)])

    @staticmethod
    def _touches(ball: Ball, seen: Sequence[float] | None) -> bool:
        """Whether a ball that came down has touched the table within the step."""
        if ball[5] >= 0 or ball[2] >= NEAR_TABLE:
            return False
        return bool(ball[2] < TABLE.bounce_height) if seen is None else seen[5] > 0

    def crossing(self, plane: float) -> Crossing:
        """Where the ball goes through y = `plane`; all 0 if it does not come nearer."""
        ball = self.ball
        if ball[4] > -SLOWEST:
            return NO_CROSSING
        if self._bounced:
            return at_plane(ball, plane, NUMBERS)
        ball, time = at_table(ball, NUMBERS)
        x, z, vx, vy, vz, more = at_plane(ball, plane, NUMBERS)
        return (x, z, vx, vy, vz, time + more)


class ManyBallFilter:
    """The estimates of N balls."""

    def __init__(self, settings: FilterSettings, count: int) -> None:
        table = gains(settings)
        self._last_before = len(table.before) - 1
        self._last = len(table.before) + len(table.after) - 1
        self._gains = np.ascontiguousarray(np.vstack([table.before, table.after]).T)
        self._mean_spin, self._step = settings.mean_spin, settings.step
        self.balls = np.zeros((7, count))
        """Position [m], velocity [m/s], top spin [rad/s]."""
        self._bounced = np.zeros(count, np.bool_)
        self._count = np.zeros(count, np.int64)

    def begin(self, which: IntArray | BoolArray | slice, seen: FloatArray) -> None:
        """New flights of some balls, with their first measurements (6, n)."""
        self.balls[:6, which] = seen
        self.balls[6, which] = self._mean_spin
        self._bounced[which] = False
        self._count[which] = 0

    def step(self, seen: FloatArray, missed: BoolArray, which: IntArray | slice = EVERY) -> None:
        """A step of some balls, with measurements (6, n); `missed` (n,) ones mean nothing."""
        ball = np.array(advanced(tuple(self.balls[:, which]), self._step, ARRAYS))
        bounced, count = self._bounced[which].copy(), self._count[which] + ~missed
        touched = _touched(ball, bounced, seen, missed)
        if touched.size:
            ball[:, touched] = rebounded_within(self._step, tuple(ball[:, touched]), ARRAYS)
            bounced[touched] = True
            count[touched] = np.where(missed[touched], -1, 0)
        off = (np.abs(seen[3:] - ball[3:6]).max(axis=0) > UNEXPLAINED) & ~missed
        after = np.minimum(count + self._last_before + 1, self._last)
        rows = np.where(bounced, after, np.minimum(count, self._last_before))
        gain = self._gains[:, rows]
        if missed.any():
            gain[:, missed] = 0.0
        ball = np.array(corrected(tuple(ball), tuple(seen), tuple(gain)))
        if off.any():
            ball[:6, off], ball[6, off] = seen[:, off], self._mean_spin
            bounced[off], count[off] = False, 0
        self.balls[:, which], self._bounced[which], self._count[which] = ball, bounced, count

    def crossings(self, plane: float, which: IntArray | slice = EVERY) -> FloatArray:
        """(6, n) of some balls, as of `OneBallFilter`."""
        ball = self.balls[:, which]
        time = np.zeros(ball.shape[1])
        comes = ball[4] <= -SLOWEST
        flying = np.flatnonzero(comes & ~self._bounced[which])
        if flying.size:
            ball = ball.copy()
            ball[:, flying], time[flying] = at_table(tuple(ball[:, flying]), ARRAYS)
        found = np.array(at_plane(tuple(ball), plane, ARRAYS))
        found[5] += time
        found[:, ~comes] = 0.0  # not by multiplication, which would make -0
        return found


def _touched(ball: FloatArray, bounced: BoolArray, seen: FloatArray, missed: BoolArray) -> IntArray:
    """Numbers of the balls that came down and have touched the table within the step."""
    maybe = np.flatnonzero(~bounced & (ball[5] < 0) & (ball[2] < NEAR_TABLE))
    if not maybe.size:
        return maybe
    below, rises = ball[2, maybe] < TABLE.bounce_height, seen[5, maybe] > 0
    touched: IntArray = maybe[np.where(missed[maybe], below, rises)]
    return touched
