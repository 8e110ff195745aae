"""Reports, on stderr, failures that a driver handles by itself."""

from __future__ import annotations

import time

from o80.base.screen import complain

AGAIN = 60.0
"""Interval between two reports of the same text [s]."""


class Trouble:
    """Failures of one device. A repeated failure is reported once a minute."""

    def __init__(self, device: str) -> None:
        self._device = device
        self._reported: dict[str, float] = {}
        self.text = ""
        """Text of the current failure; empty: none."""

    def tell(self, text: str) -> None:
        text = " ".join(text.split())
        self.text = text
        now = time.monotonic()
        if now - self._reported.get(text, -AGAIN) < AGAIN:
            return
        if len(self._reported) > 100:  # limits memory for ever-changing texts
            self._reported.clear()
        self._reported[text] = now
        complain(f"{self._device}: {text}; tries again")

    def is_over(self) -> None:
        if self.text and self._reported:
            complain(f"{self._device}: works again")
            self._reported.clear()
        self.text = ""
