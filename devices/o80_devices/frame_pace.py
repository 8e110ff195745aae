"""Paces a sensor's iterations by its frames, within a limit ahead of the clock."""

from __future__ import annotations

import time
from collections.abc import Callable

MAX_AHEAD = 3.0  # periods; the loop allows ten, see docs/drivers/own_clock.md


class FramePace:
    """Allots one iteration to each frame, although frames arrive early and late.

    A frame after the deadline of its iteration begins another one, early. The loop ends a
    driver that runs ahead of the clock; the accumulated lead is therefore counted as in the loop.
    """

    def __init__(self) -> None:
        self.period = 0  # [ns]
        self._ahead = 0
        self._last: int | None = None
        self._missed = False

    def wait(self, due: int, arrives: Callable[[int], bool]) -> None:
        """Waits for a frame of the iteration that is due [ns].

        arrives: waits until a deadline [ns] at most; returns whether a frame has arrived.
        """
        spare = round(MAX_AHEAD * self.period) - self._ahead
        earliest = due - max(0, min(self.period, spare))
        # after a missed frame the return is on time, so that iterations stay in phase
        self._missed = not arrives(due if self._missed else due + self.period // 4)
        time.sleep(max(0, earliest - time.monotonic_ns()) * 1e-9)
        now = time.monotonic_ns()
        if self._last is not None:
            self._ahead = max(0, self._ahead + self.period - (now - self._last))
        self._last = now
