"""Driver that simulates all cameras of a rig, with thrown balls or the ball of a segment."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from o80.drivers import Reading, Seed, option
from o80_devices.cameras.ball_of_segment import BallOfSegment
from o80_devices.cameras.rig import Rig, four_cameras
from o80_devices.cameras.scene import Scene
from o80_devices.cameras.throws import Throws


class SyntheticCameras:
    """Publishes simultaneous images of all cameras, and the true ball beside them.

    With the ball of another segment, images are older than their rows by `latency`, so that the
    segment's rows around that time exist. An image without such rows has capture_time 0.

    Use a short history (`--history 4`): a row of four cameras takes 3.7 MB.
    """

    simulated = True
    units: ClassVar = {"capture_time": "ns", "position": "m", "velocity": "m/s", "spin": "rad/s"}

    @dataclass
    class Config:
        rig: str = option("", "file of the rig; without one, four cameras around a table")
        exposure: float = option(0.002, "time for which the shutter is open", "s")
        noise: float = option(3.0, "standard deviation of a value of a pixel, of 255")
        seed: Seed = Seed(0)  # noqa: RUF009
        ball: str = option("", "segment of a world whose ball is seen; without one, thrown balls")
        field: str = option("observed.balls", "of that segment: position and velocity of the ball")
        times: str = option("", "segment that says when rows of a bursting world were")
        latency: float = option(0.025, "age of the images of that ball", "s")

    def __init__(self, config: Config) -> None:
        self._config = config
        self.simulated = not config.ball  # a replay has no world segment
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
        self._world = (
            BallOfSegment(config.ball, config.field, config.times) if config.ball else None
        )

    def read(self, reading: Reading) -> None:
        if self._begin is None:
            self._begin = reading.time
        row, ball, time = reading.extended, None, reading.time
        if self._world is None:
            ball = self._throws.at((time - self._begin) * 1e-9)
        else:
            time -= round(self._config.latency * 1e9)
            ball = self._world.at(time, reading.time)
        flies = ball is not None and ball.number > 0
        row["capture_time"] = 0 if ball is None else time
        row["true_ball"]["number"] = 0 if ball is None else ball.number
        for name in ("position", "velocity", "spin"):
            row["true_ball"][name] = getattr(ball, name) if flies else np.nan
        if ball is None:
            return
        for i, image in enumerate(row["images"]):
            into = image.reshape(self._shape)
            self._scene.image(
                i, ball.position if flies else None, ball.velocity if flies else None, into
            )

    def stop(self) -> None:
        if self._world is not None:
            self._world.close()
