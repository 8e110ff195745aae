"""Recordings of a robot beside a tracked ball, as the tracking server would have sent the ball.

A line is a tuple `((ball, unix time [ns], position, velocity), (steady time [ns], q, dq))`, at
250 Hz. A line repeats the newest message of the tracker; ball -1: not seen, and the
position is an old one. The two times are of different clocks.
"""

from __future__ import annotations

import ast
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from o80.base.arrays import FloatArray, IntArray
from o80.errors import InvalidArgument
from o80_devices.ball_tracking.server_messages import Message
from o80_devices.clock import ClockMap

UNSEEN = -1


@dataclass(frozen=True, eq=False)
class RobotAndBall:
    """The rows of a recording."""

    ball: IntArray
    """(N,) number of the ball; -1: not seen."""
    stamp: IntArray
    """(N,) stamp of the tracker, unix time [ns]."""
    position: FloatArray
    """(N, 3) [m]"""
    velocity: FloatArray
    """(N, 3) as recorded [m/s]."""
    time: IntArray
    """(N,) time of the robot, steady clock [ns]."""
    q: FloatArray
    """(N, 4) [rad]"""
    dq: FloatArray
    """(N, 4) [rad/s]"""

    @classmethod
    def load(cls, path: str | Path) -> RobotAndBall:
        """Reads a file. Raises InvalidArgument, which names file and line."""
        rows = []
        for number, line in enumerate(Path(path).read_text().splitlines(), start=1):
            try:
                ball, robot = ast.literal_eval(line)
                row = (int(ball[0]), int(ball[1]), ball[2], ball[3], int(robot[0]), *robot[1:])
                if [len(part) for part in (row[2], row[3], row[5], row[6])] != [3, 3, 4, 4]:
                    raise ValueError("lists must have 3, 3, 4 and 4 numbers")
                rows.append(row)
            except (ValueError, SyntaxError, TypeError, IndexError) as error:
                raise InvalidArgument(
                    f"{path}, line {number}: not a row of robot and ball ({error})"
                ) from None
        if not rows:
            raise InvalidArgument(f"{path}: the file is empty")
        return cls(*(np.array(column) for column in zip(*rows, strict=True)))

    def first_rows(self) -> IntArray:
        """Numbers of the rows that hold a message of the tracker for the first time."""
        new = np.diff(self.stamp, prepend=self.stamp[0] - 1) > 0
        return np.flatnonzero(new & (self.ball != UNSEEN))

    def messages(self) -> list[tuple[int, Message]]:
        """Returns each message with its arrival on the robot's clock [ns].

        While the ball was not seen, each row of the robot gives a message without a ball, stamped
        by the tracker's clock.
        """
        shown = set(self.first_rows().tolist())
        ahead = self._clock_ahead()
        sent: list[tuple[int, Message]] = []
        for row, time in enumerate(self.time.tolist()):
            if row in shown:
                sent.append((time, Message(int(self.stamp[row]), self.position[row])))
            elif self.ball[row] == UNSEEN:
                sent.append((time, Message(time + ahead, None)))
        return _rising(sent)

    def capture_times(self) -> tuple[IntArray, IntArray]:
        """Returns the rows with a new ball, and their capture times on the robot's clock [ns]."""
        clock, rows, times = ClockMap(), [], []
        for row in self.first_rows().tolist():
            capture = clock.capture(int(self.stamp[row]), int(self.time[row]))
            if capture is not None:
                rows.append(row)
                times.append(capture.time)
        return np.array(rows, np.int64), np.array(times, np.int64)

    def _clock_ahead(self) -> int:
        """Offset of the tracker's clock from the robot's, by the fastest message [ns]."""
        rows = self.first_rows()
        return int((self.stamp - self.time)[rows].max()) if len(rows) else 0


def _rising(sent: list[tuple[int, Message]]) -> list[tuple[int, Message]]:
    """Drops messages without a ball that are out of order."""
    seen = [message.stamp for _, message in sent if message.place is not None]
    next_seen = iter([*seen, None])
    following, newest, kept = next(next_seen), None, []
    for time, message in sent:
        if message.place is not None:
            following = next(next_seen)
        elif (newest is not None and message.stamp <= newest) or (
            following is not None and message.stamp >= following
        ):
            continue
        newest = message.stamp
        kept.append((time, message))
    return kept
