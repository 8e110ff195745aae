"""Shows an environment in the browser, for `render_mode="human"`."""

from __future__ import annotations

import time

import o80
from o80.base.screen import complain

RENDER_MODES = ["human", "rgb_array"]


class Page:
    """Runs `o80 view` of arm and worlds, and opens the page if there is a screen.

    An accelerated environment is slowed down to real time.
    """

    def __init__(self, shown: list[o80.Frontend], step: float) -> None:
        """step: duration of an accelerated environment's step [s]; 0: in real time."""
        from o80.view.browser import has_screen

        screen = has_screen()
        self._view = o80.View(shown, open_browser=screen)
        self._step = step
        self._due = 0.0
        if not screen:
            complain(f"no screen found; the view is at {self._view.url}")

    def after_step(self) -> None:
        """Waits until the step has lasted as long as in real time."""
        if self._step:
            now = time.monotonic()
            time.sleep(max(0.0, self._due - now))
            self._due = max(self._due, now) + self._step

    def close(self) -> None:
        """Ends the process of the page; may be called twice."""
        self._view.close()
