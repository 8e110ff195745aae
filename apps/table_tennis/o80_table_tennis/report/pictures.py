"""What `render_mode="rgb_array"` returns: pictures of arm and balls as they were last published."""

from __future__ import annotations

from ..rig.rig import Rig
from ..rig.virtual_balls import VirtualBalls
from .rendering import Image, Scene


class Pictures:
    """Draws the newest rows of a rig. The scene is made with the first picture."""

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

    def close(self) -> None:
        """May be called twice."""
        if self._scene is not None:
            self._scene.close()
            self._scene = None
