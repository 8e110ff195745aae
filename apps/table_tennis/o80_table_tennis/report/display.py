"""How an environment is shown in the browser, with `render_mode="human"`."""

from __future__ import annotations

import time

import o80
from o80.base.screen import complain

RENDER_MODES = ["human", "rgb_array"]


class Page:
    """`o80 view` of arm and worlds, in a process of its own; opened where there is a screen.

    An accelerated environment is slowed down to real time, so that its motion can be followed.
    """

    def __init__(self, shown: list[o80.Frontend], step: float) -> None:
        """step: duration of a step of an accelerated environment [s]; 0 by the clock."""
        from o80.view.browser import has_screen

        screen = has_screen()
        self._view = o80.View(shown, open_browser=screen)
        self._step = step
        self._due = 0.0
        if not screen:
            complain(f"no screen found; the view is at {self._view.url}")

    def after_step(self) -> None:
        """Waits until the step has taken as long as in real time."""
        if self._step:
            now = time.monotonic()
            time.sleep(max(0.0, self._due - now))
            self._due = max(self._due, now) + self._step

    def close(self) -> None:
        """Ends the process of the page; may be called twice."""
        self._view.close()
