"""A driver that plays all cameras of a rig, which see balls that are thrown."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from o80.drivers import Reading, Seed, option
from o80_devices.ball_tracking.rig import Rig, four_cameras
from o80_devices.ball_tracking.scene import Scene
from o80_devices.ball_tracking.throws import Throws


class SyntheticCameras:
    """The images of all cameras, taken at the same time, and the true ball beside them.

    Start it with a short history (`--history 4`): a row of four cameras takes 3.7 MB.
    """

    of_the_world = False
    units: ClassVar = {"capture_time": "ns", "position": "m", "velocity": "m/s", "spin": "rad/s"}

    @dataclass
    class Config:
        rig: str = option("", "file of the rig; without one, four cameras around a table")
        exposure: float = option(0.002, "time for which the shutter is open", "s")
        noise: float = option(3.0, "standard deviation of a value of a pixel, of 255")
        seed: Seed = Seed(0)  # noqa: RUF009

    def __init__(self, config: Config) -> None:
        self._config = config
        self.rig = Rig.load(config.rig) if config.rig else four_cameras()
        sizes = {camera.size for camera in self.rig.cameras}
        if len(sizes) > 1:
            raise ValueError(f"the images of one segment have one size, the rig has {sizes}")
        ((width, height),) = sizes
        true_ball = {
            "number": np.int64,
            "position": (np.float64, (3,)),
            "velocity": (np.float64, (3,)),
            "spin": (np.float64, (3,)),
        }
        self.extended: dict[str, Any] = {
            "capture_time": np.int64,
            "true_ball": true_ball,
            "images": (np.uint8, (len(self.rig.cameras), height * width * 3)),
        }
        self._shape = (height, width, 3)
        self._begin: int | None = None

    def start(self) -> None:
        config = self._config
        self._scene = Scene(
            self.rig, exposure=config.exposure, noise=config.noise, seed=config.seed
        )
        self._throws = Throws(self.rig, config.seed)

    def read(self, reading: Reading) -> None:
        if self._begin is None:
            self._begin = reading.time
        ball = self._throws.at((reading.time - self._begin) * 1e-9)
        flies = ball.number > 0
        row = reading.extended
        row["capture_time"] = reading.time
        row["true_ball"]["number"] = ball.number
        for name in ("position", "velocity", "spin"):
            row["true_ball"][name] = getattr(ball, name) if flies else np.nan
        for i, image in enumerate(row["images"]):
            into = image.reshape(self._shape)
            self._scene.image(i, ball.position if flies else None, ball.velocity, into)
