"""How an environment is shown: `render_mode="rgb_array"` as pictures, `"human"` in the browser."""

from __future__ import annotations

import sys
import time
from typing import Protocol

import o80

from ..rig.rig import Rig
from ..rig.virtual_balls import VirtualBalls
from .rendering import Image, Scene

RENDER_MODES = ["human", "rgb_array"]


class Display(Protocol):
    """Shows the newest rows of a rig."""

    def render(self) -> Image | None:
        """Result of the environment's `render`."""
        ...

    def after_step(self) -> None:
        """A step of the environment has ended."""
        ...

    def close(self) -> None:
        """May be called twice."""
        ...


def display_of(rig: Rig, virtual: VirtualBalls, *, render_mode: str, camera: str) -> Display:
    """The display of a render mode."""
    return Page(rig) if render_mode == "human" else Pictures(rig, virtual, camera=camera)


class Pictures:
    """Draws arm and balls as they were last published. The scene is made with the first picture."""

    def __init__(self, rig: Rig, virtual: VirtualBalls, *, camera: str) -> None:
        self._twin, self._virtual, self._camera = rig.twins[0], virtual, camera
        self._balls = 1 + rig.settings.extra_balls
        self._scene: Scene | None = None

    def render(self) -> Image:
        """A picture (480, 640, 3)."""
        if self._scene is None:
            self._scene = Scene(balls=self._balls)
        return self._scene.draw(
            self._twin.joint_positions, self._virtual.positions(), camera=self._camera
        )

    def after_step(self) -> None:
        """Nothing: a picture is drawn when it is asked for."""

    def close(self) -> None:
        """May be called twice."""
        if self._scene is not None:
            self._scene.close()
            self._scene = None


class Page:
    """`o80 view` of arm and twins, in a process of its own; opened where there is a screen.

    An accelerated environment is slowed down to real time, so that its motion can be followed.
    """

    def __init__(self, rig: Rig) -> None:
        from o80.view.browser import has_screen

        shown = [twin.frontend for twin in rig.twins] + [rig.arm.frontend]
        screen = has_screen()
        self._view = o80.View(shown, open_browser=screen)
        self._step = 0.0 if rig.settings.pacing.real_time else rig.settings.step
        self._due = 0.0
        if not screen:
            print(f"o80: no screen found; the view is at {self._view.url}", file=sys.stderr)

    @property
    def url(self) -> str:
        """Address of the page."""
        return self._view.url

    def render(self) -> None:
        """Nothing: the page shows every row by itself."""

    def after_step(self) -> None:
        """Waits until the step has taken as long as in real time."""
        if self._step:
            now = time.monotonic()
            time.sleep(max(0.0, self._due - now))
            self._due = max(self._due, now) + self._step

    def close(self) -> None:
        """Ends the process of the page; may be called twice."""
        self._view.close()
