"""Offset from the monotonic clock of rows to the wall clock, which stamps of ROS are on."""

import time
from collections.abc import Callable

from o80.errors import InvalidArgument

STEP = 5_000_000
"""Smallest change between two readings that counts as a step, not as a correction [ns]."""
UNCERTAIN = 1_000_000_000
"""Time after a step in which messages may still come that were stamped before it [ns]."""

Clock = Callable[[], int]


class WallClock:
    """Reads the offset again and again."""

    def __init__(self, wall: Clock = time.time_ns, monotonic: Clock = time.monotonic_ns) -> None:
        self._wall, self._monotonic = wall, monotonic
        self._stepped_at: int | None = None  # on the monotonic clock [ns]
        self.offset = self._measured()  #: added to the time of a row [ns]

    def _measured(self) -> int:
        """Offset of the shortest of three readings: each may be interrupted."""
        readings = [(self._monotonic(), self._wall(), self._monotonic()) for _ in range(3)]
        before, wall, after = min(readings, key=lambda each: each[2] - each[0])
        return wall - (before + after) // 2

    def update(self) -> int:
        """Reads the offset anew; returns the step since the last reading [ns], 0 for none."""
        change = (offset := self._measured()) - self.offset
        if abs(change) >= STEP:
            self._stepped_at = self._monotonic()
        self.offset = offset
        return change if abs(change) >= STEP else 0

    def row_time(self, stamp: int) -> int:
        """Time on the clock of rows [ns]. Raises InvalidArgument for a stamp across a step."""
        self.update()
        time, step = stamp - self.offset, self._stepped_at
        if step is not None and (time < step or self._monotonic() < step + UNCERTAIN):
            raise InvalidArgument("the wall clock was set since the stamp: stamp it a second later")
        return time
