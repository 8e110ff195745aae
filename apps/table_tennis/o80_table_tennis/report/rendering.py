"""Pictures and films of the table, the arm and the balls, from published positions."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from o80.base.arrays import FloatArray, Image
from o80.base.lifecycle import Closeable
from o80.view.pictures import SHADOWS, renderer_of_mujoco, write_film

from ..world.arm import JOINT_NAMES
from ..world.ball import BALL_RADIUS
from ..world.scene import MODEL

CAMERAS = ("side", "behind", "close")
SIZE = (640, 480)
"""Width and height of pictures [pixels]."""
HALF_SIZE = (480, 360)
"""Size of each picture in a film of several."""
TITLE_HEIGHT = 28
"""Height of the line above each of them."""
FRAMES_PER_SECOND = 25.0
SLOW = 2.0
"""So many times slower than it was is what a film shows."""
OTHER_BALL = (0.95, 0.95, 0.92, 0.8)
"""Colour of the balls beside the one that is played."""


class Scene(Closeable):
    """Draws the scene with any number of balls, without a screen.

    Needs the extra `rendering`, and EGL or OSMesa; MUJOCO_GL chooses between them. Raises
    o80.MissingExtra.
    """

    def __init__(self, *, balls: int = 1, size: tuple[int, int] = SIZE) -> None:
        self._mujoco = mujoco = renderer_of_mujoco()
        self._model = _model_with(balls)
        self._model.vis.quality.shadowsize = SHADOWS
        self._model.vis.quality.offsamples = 4
        self._data = mujoco.MjData(self._model)
        self._balls = [self._free_joint(ball) for ball in range(balls)]
        self._arm = [int(self._model.joint(name).qposadr[0]) for name in JOINT_NAMES]
        self._renderer = mujoco.Renderer(self._model, size[1], size[0])

    def close(self) -> None:
        """Gives the renderer back; may be called twice."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None

    def draw(self, joints: FloatArray, balls: FloatArray, *, camera: str = "side") -> Image:
        """A fresh picture (height, width, 3) of joints (4,) [rad] and balls (B, 3) [m]."""
        if self._renderer is None:
            raise RuntimeError("this scene was closed; make a new one")
        if camera not in CAMERAS:
            raise ValueError(f"unknown camera '{camera}'; there are: {', '.join(CAMERAS)}")
        self._data.qpos[self._arm] = joints
        for place, ball in zip(self._balls, balls, strict=True):
            self._data.qpos[place : place + 3] = ball
        self._mujoco.mj_kinematics(self._model, self._data)
        self._mujoco.mj_camlight(self._model, self._data)
        self._renderer.update_scene(self._data, camera)
        picture: Image = self._renderer.render().copy()
        return picture

    def _free_joint(self, ball: int) -> int:
        return int(self._model.joint(_ball_name(ball)).qposadr[0])


def film_episode(path: Path, joints: FloatArray, balls: FloatArray, *, period: float) -> int:
    """A film of rows of joints (T, 4) [rad] and balls (T, B, 3) [m], `period` [s] apart.

    Half as fast as it was. Returns how many frames it has.
    """
    step = _rows_of_frame(FRAMES_PER_SECOND, period)
    with Scene(balls=balls.shape[1]) as scene:
        pictures = (scene.draw(joints[row], balls[row]) for row in range(0, len(joints), step))
        return write_film(path, pictures, frames_per_second=FRAMES_PER_SECOND)


def film_side_by_side(
    path: Path, episodes: Mapping[str, tuple[FloatArray, FloatArray]], *, period: float
) -> int:
    """One film of several episodes, each of joints (T, 4) [rad] and its ball (T, 3) [m].

    Half as fast as they were. The name of each episode stands above its picture. All begin
    together; an episode that has ended shows its last row. Returns the number of frames.
    """
    rate = FRAMES_PER_SECOND / len(episodes)
    rows = max(len(joints) for joints, _ in episodes.values())
    titles = np.hstack([_title(name, HALF_SIZE[0]) for name in episodes])
    with Scene(size=HALF_SIZE) as scene:  # drawn one after the other: a renderer costs much memory

        def at(row: int, joints: FloatArray, ball: FloatArray) -> Image:
            there = ball[min(row, len(ball) - 1), None]
            return scene.draw(joints[min(row, len(joints) - 1)], there)

        pictures = (
            np.vstack([titles, np.hstack([at(row, *each) for each in episodes.values()])])
            for row in range(0, rows, _rows_of_frame(rate, period))
        )
        return write_film(path, pictures, frames_per_second=rate)


def _rows_of_frame(frames_per_second: float, period: float) -> int:
    return max(1, round(1.0 / (frames_per_second * SLOW * period)))


def _title(text: str, width: int) -> Image:
    """A line of text in black on white (TITLE_HEIGHT, width, 3)."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width / 100, TITLE_HEIGHT / 100), dpi=100)
    figure.text(0.5, 0.5, text, ha="center", va="center", fontsize=11)
    canvas: Any = FigureCanvasAgg(figure)
    canvas.draw()
    picture: Image = np.asarray(canvas.buffer_rgba())[..., :3].copy()
    return picture


def write_picture(path: Path, picture: Image) -> None:
    """Writes a picture (height, width, 3) as PNG."""
    from matplotlib.image import imsave

    imsave(path, picture)


def _ball_name(ball: int) -> str:
    return "ball" if ball == 0 else f"ball_{ball}"


def _model_with(balls: int) -> Any:
    """The model of the scene with so many balls."""
    import mujoco

    spec = mujoco.MjSpec.from_file(str(MODEL))
    for ball in range(1, balls):
        body = spec.worldbody.add_body(name=_ball_name(ball))
        body.add_freejoint(name=_ball_name(ball))
        geom = body.add_geom(size=[BALL_RADIUS, 0, 0], rgba=OTHER_BALL)
        geom.type = mujoco.mjtGeom.mjGEOM_SPHERE
    return spec.compile()
