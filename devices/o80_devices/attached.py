"""Frontend of a segment that may end and restart."""

from __future__ import annotations

import o80

RETRY = 50_000_000
"""Interval between attempts to attach [ns]."""


class Attached:
    """Attaches to a segment, and again after its end."""

    def __init__(self, segment: str, *, read_only: bool = True) -> None:
        self._segment, self._read_only = segment, read_only
        self._frontend: o80.Frontend | None = None
        self._next_try: int | None = None

    def attach(self, timeout: float) -> o80.Frontend:
        """Waits for the segment [s]. Raises TimeoutError, or what else Frontend raises."""
        self._frontend = o80.Frontend(self._segment, timeout=timeout, read_only=self._read_only)
        self.check(self._frontend)
        return self._frontend

    def check(self, frontend: o80.Frontend) -> None:
        """Raises InvalidArgument if the segment is of no use."""

    def frontend(self, now: int) -> tuple[o80.Frontend | None, bool]:
        """Returns the frontend (None: no backend), and whether it is new since the last call."""
        if self._frontend is not None and not self._frontend.alive:
            self.close()
        if self._frontend is not None:
            return self._frontend, False
        if self._next_try is not None and now < self._next_try:
            return None, True
        self._next_try = now + RETRY
        try:
            self.attach(timeout=0.0)
        except o80.Error:
            self.close()
        return self._frontend, True

    def close(self) -> None:
        if self._frontend is not None:
            self._frontend.close()
        self._frontend = None
