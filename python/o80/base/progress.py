"""Shows the progress of reading a long file: on stderr, or as a warning."""

import sys
import time
import warnings
from typing import Self

from o80.base.screen import complain, overwrite

AFTER = 1.0  # time after which progress is shown [s]
BETWEEN = 0.2  # interval of figures on a terminal [s]
of_a_command = False
"""Whether this process is a command (`o80 info`); else a program that uses o80."""


class Progress:
    """Progress of one file; in its `with` block the reader calls `at` repeatedly."""

    def __init__(self, text: str) -> None:
        """text: names the slow work; shown once."""
        self._text = text
        self._next = time.monotonic() + AFTER
        self._shown = False

    def at(self, share: float) -> None:
        """Shows the share of the work that is done, from 0 to 1."""
        now = time.monotonic()
        if now < self._next:
            return
        self._next = now + BETWEEN
        if not self._shown:
            self._shown = True
            if of_a_command:
                complain(self._text)
            else:
                warnings.warn(self._text, RuntimeWarning, stacklevel=2)
        self._show(f"{share:.0%}")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        if self._shown:
            self._show("")

    def _show(self, figure: str) -> None:
        if of_a_command and sys.stderr.isatty():
            overwrite(figure)
