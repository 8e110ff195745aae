"""Measures the offset from the rows' monotonic clock to the wall clock of ROS stamps."""

import time
from collections.abc import Callable

from o80.errors import InvalidArgument

STEP = 5_000_000
"""Least change between two readings that counts as a step, not as a drift correction [ns]."""
UNCERTAIN = 1_000_000_000
"""Time after a step during which messages stamped before may still arrive [ns]."""

Clock = Callable[[], int]


class WallClock:
    """Tracks the offset, and detects steps of the wall clock."""

    def __init__(self, wall: Clock = time.time_ns, monotonic: Clock = time.monotonic_ns) -> None:
        self._wall, self._monotonic = wall, monotonic
        self._stepped_at: int | None = None  # monotonic time [ns]
        self.offset = self._measured()  #: added to the time of a row [ns]

    def _measured(self) -> int:
        """Measures the offset; takes the shortest of three readings, as each may be interrupted."""
        readings = [(self._monotonic(), self._wall(), self._monotonic()) for _ in range(3)]
        before, wall, after = min(readings, key=lambda each: each[2] - each[0])
        return wall - (before + after) // 2

    def update(self) -> int:
        """Measures the offset again; returns a step since the last reading [ns], else 0."""
        change = (offset := self._measured()) - self.offset
        if abs(change) >= STEP:
            self._stepped_at = self._monotonic()
        self.offset = offset
        return change if abs(change) >= STEP else 0

    def row_time(self, stamp: int) -> int:
        """Converts a stamp to the rows' clock [ns]. Raises InvalidArgument across a step."""
        self.update()
        time, step = stamp - self.offset, self._stepped_at
        if step is not None and (time < step or self._monotonic() < step + UNCERTAIN):
            raise InvalidArgument("the wall clock was set since the stamp: stamp it a second later")
        return time
