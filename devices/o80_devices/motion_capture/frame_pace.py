"""When an iteration of a sensor may end: with a frame, but never too far ahead of the clock."""

from __future__ import annotations

MAX_AHEAD = 3.0  # periods; the loop allows ten, see docs/drivers.md


class FramePace:
    """One iteration for each frame, although frames come early and late.

    A frame that comes after the deadline of its iteration begins one more, early. The loop ends a
    driver that runs ahead of the clock, so the sum of what came early is counted as the loop does.
    """

    def __init__(self) -> None:
        self.period = 0  # [ns]
        self._ahead = 0
        self._last: int | None = None
        self._missed = False

    def times(self, due: int) -> tuple[int, int]:
        """The earliest and the latest time of the next return [ns]."""
        spare = round(MAX_AHEAD * self.period) - self._ahead
        earliest = due - max(0, min(self.period, spare))
        # after a missed frame: on time, so that iterations keep their places
        return earliest, due if self._missed else due + self.period // 4

    def returned(self, now: int, *, missed: bool) -> None:
        if self._last is not None:
            self._ahead = max(0, self._ahead + self.period - (now - self._last))
        self._last = now
        self._missed = missed
