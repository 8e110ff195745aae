"""Tells the user, on the standard error, of a failure that a driver deals with by itself."""

from __future__ import annotations

import time

from o80.base.screen import complain

AGAIN = 60.0
"""The same text is not printed again for so long [s]."""


class Trouble:
    """Trouble with one device. A failure that repeats itself is reported once a minute."""

    def __init__(self, device: str) -> None:
        self._device = device
        self._told: dict[str, float] = {}
        self.text = ""
        """Text of the trouble; empty: none."""

    def tell(self, text: str) -> None:
        text = " ".join(text.split())
        self.text = text
        now = time.monotonic()
        if now - self._told.get(text, -AGAIN) < AGAIN:
            return
        if len(self._told) > 100:  # texts that differ each time
            self._told.clear()
        self._told[text] = now
        complain(f"{self._device}: {text}; tries again")

    def is_over(self) -> None:
        if self.text and self._told:
            complain(f"{self._device}: works again")
            self._told.clear()
        self.text = ""
