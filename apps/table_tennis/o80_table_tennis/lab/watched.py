"""A segment that may end and come back: attached to when it is there, missing when it is silent."""

from __future__ import annotations

import time

import o80

RETRY = 0.05
"""Between two attempts to attach [s]."""
SILENT = 0.1
"""Without a row for so long a segment that does not burst counts as missing [s]."""


class Watched:
    """An observer of one segment."""

    def __init__(self, segment: str, *, read_only: bool = True) -> None:
        self.segment = segment
        self._read_only = read_only
        self._frontend: o80.Frontend | None = None
        self._next_try = 0.0

    def frontend(self) -> o80.Frontend | None:
        """Attached to the living backend; None: there is none."""
        if self._frontend is not None and not self._frontend.alive:
            self.close()
        if self._frontend is None and time.monotonic() >= self._next_try:
            self._next_try = time.monotonic() + RETRY
            try:
                self._frontend = o80.Frontend(self.segment, timeout=0.0, read_only=self._read_only)
            except o80.Error:
                return None
        return self._frontend

    @property
    def missing(self) -> bool:
        """There is no backend, or it has published nothing for a while."""
        frontend = self.frontend()
        if frontend is None:
            return True
        age = frontend.row_age
        return age is not None and age > SILENT

    def close(self) -> None:
        """Lets go; the next look attaches again."""
        if self._frontend is not None:
            self._frontend.close()
        self._frontend = None
