"""Pictures and films of a robot's model, drawn without a screen."""

import ctypes.util
import importlib
import os
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import o80._core as _core
from o80.base.arrays import Image
from o80.base.errors import InvalidArgument
from o80.base.extras import needed
from o80.base.lifecycle import Closeable
from o80.frontend.frontend import Frontend
from o80.view.scene import Scene
from o80.view.source import Source
from o80.view.world import drawn

if TYPE_CHECKING:
    from o80.recording.recorded_epoch import RecordedEpoch

SHADOWS = 1024
"""Size of the map of shadows [pixels]: finer ones take software renderers much longer."""


class Pictures(Closeable):
    """Draws rows of a robot by its model, without a screen.

    robot: a frontend, or a run of a recording (`o80.open(file)["arm"].epochs[0]`).
    size: width and height [pixels].
    camera: name or number of a camera of the model; -1: from outside (None: the first camera that
        is fixed in the world, or from outside).
    model_files: read the files (meshes) that the model names. Only for models that you trust.

    Needs the extra `rendering`, and EGL or OSMesa; MUJOCO_GL chooses between them. Raises
    o80.MissingExtra, and InvalidArgument for a robot without a model and for an unknown camera.
    """

    def __init__(
        self,
        robot: "Frontend | RecordedEpoch | Source",
        *,
        size: tuple[int, int] = (480, 360),
        camera: str | int | None = None,
        model_files: bool = False,
    ) -> None:
        mujoco = renderer_of_mujoco()
        what = drawn(robot.schema, robot.model, trusted=model_files)
        if what is None:
            raise InvalidArgument(f"'{robot.schema['robot']}' has no model that could be drawn")
        self._scene = Scene(robot.schema, what)
        model = self._scene.model
        cameras = [model.camera(i).name for i in range(model.ncam)]
        if camera is None:
            camera = next((i for i in range(model.ncam) if model.cam_bodyid[i] == 0), -1)
        if camera not in cameras and camera not in range(-1, len(cameras)):
            known = ", ".join(map(str, cameras)) or "none"
            raise InvalidArgument(f"the model has no camera {camera!r}; it has: {known}")
        self._camera = camera
        model.vis.quality.shadowsize = SHADOWS
        model.vis.global_.offwidth = max(size[0], model.vis.global_.offwidth)
        model.vis.global_.offheight = max(size[1], model.vis.global_.offheight)
        self._renderer = mujoco.Renderer(model, size[1], size[0])

    def draw(self, row: _core.Observation) -> Image:
        """Draws a fresh picture (height, width, 3) of the observed positions in a row."""
        if self._renderer is None:
            raise InvalidArgument("these pictures were closed; make new ones")
        return self._scene.picture(row, self._renderer, self._camera)

    def close(self) -> None:
        """Releases the renderer; may be called twice."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None


def renderer_of_mujoco() -> Any:
    """Returns the module mujoco, which draws without a screen: with EGL if it exists, else OSMesa.

    MuJoCo reads the variable MUJOCO_GL at its first import; after that, its choice is replaced.
    Raises o80.MissingExtra without OpenGL or mujoco.
    """
    needed("OpenGL", "rendering", "a picture")
    usual = "egl" if ctypes.util.find_library("EGL") else "osmesa"
    chosen = os.environ.setdefault("MUJOCO_GL", usual)
    contexts: Any = sys.modules.get("mujoco.rendering.classic.gl_context")
    if contexts is not None and chosen in ("egl", "osmesa"):
        contexts.GLContext = importlib.import_module(f"mujoco.{chosen}").GLContext
    return needed("mujoco", "rendering", "a picture")


PALETTE = "split[a][b];[a]palettegen=max_colors=128[p];[b][p]paletteuse=dither=none"
GIF: dict[str, Any] = {
    "codec": "gif",
    "pix_fmt_out": "pal8",
    "macro_block_size": 1,
    "ffmpeg_log_level": "error",
    "output_params": ["-filter_complex", PALETTE, "-loop", "0"],
}
"""Options of ffmpeg for a film with the best 128 colours."""


def write_film(path: Path, pictures: Iterable[Image], *, frames_per_second: float) -> int:
    """Writes pictures (height, width, 3) as NAME.mp4 or NAME.gif; returns the number of frames.

    Needs the extra `rendering`; raises o80.MissingExtra.
    """
    imageio_ffmpeg: Any = needed("imageio_ffmpeg", "rendering", "a film")
    writer: Any = None
    frames = 0
    try:
        for picture in pictures:
            if writer is None:
                height, width = picture.shape[:2]
                size = (width, height)
                options = GIF if path.suffix == ".gif" else {"macro_block_size": 2}
                writer = imageio_ffmpeg.write_frames(
                    str(path.absolute()), size, fps=frames_per_second, **options
                )
                writer.send(None)
            writer.send(np.ascontiguousarray(picture))
            frames += 1
    finally:
        if writer is not None:
            writer.close()
    return frames
