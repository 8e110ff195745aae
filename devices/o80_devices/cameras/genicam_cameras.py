"""A driver of GenICam cameras (GigE Vision, USB3 Vision): images with the cameras' own stamps."""

from __future__ import annotations

import time
from dataclasses import dataclass
from threading import Condition
from typing import Any, ClassVar, get_args

import numpy as np

from o80.drivers import Desired, Reading, option
from o80.errors import InvalidArgument
from o80_devices.cameras import aravis
from o80_devices.cameras.newest_image import CameraReason, NewestImage
from o80_devices.cameras.pixel_formats import PixelFormat
from o80_devices.frame_pace import FramePace

SECOND = 1_000_000_000  # [ns]


class GenicamCameras:
    """Publishes the images of several cameras in one segment; recorded only if named.

    A row waits until each camera has a new image, at most for a quarter of a
    period. `valid` marks the cameras with a new image, `reasons` says why the others have none.
    """

    units: ClassVar = {
        "capture_time": "ns",
        "times": "ns",
        "errors": "ns",
        "stamps": "ns",
    }

    @dataclass
    class Config:
        sources: str = option("", "serial numbers or addresses of cameras, separated by commas")
        width: int = option(640, "of an image", "px")
        height: int = option(480, "of an image", "px")
        left: int = option(0, "first column of the sensor that is read", "px")
        top: int = option(0, "first row of the sensor that is read", "px")
        pixel_format: PixelFormat = option("BayerRG8", "in which they send")  # noqa: RUF009
        rate: float = option(0.0, "of cameras that are not triggered; 0: as they are set", "1/s")
        exposure: float = option(0.0, "time; 0: as the cameras are set", "s")
        trigger: str = option("", "line that triggers the cameras, such as Line1; empty: none")
        latency: float = option(0.0, "from capture to the earliest arrival", "s")
        silent_after: float = option(0.08, "without an image, after which rows say silent", "s")

    def __init__(self, config: Config) -> None:
        self._sources = [each.strip() for each in config.sources.split(",") if each.strip()]
        if not self._sources:
            raise InvalidArgument(
                "name the cameras: --sources 192.168.0.11,192.168.0.12 (`python -m "
                "o80_devices.cameras.list_cameras` lists them; Fake_1 needs no camera)"
            )
        if len(set(self._sources)) < len(self._sources):
            raise InvalidArgument(f"a camera is named twice: --sources {config.sources}")
        for name in ("width", "height"):
            if not 1 <= getattr(config, name) <= 16384:
                raise InvalidArgument(
                    f"{name} must be from 1 to 16384, got {getattr(config, name)}"
                )
        for name in ("left", "top", "rate", "exposure", "latency"):
            if not 0 <= getattr(config, name) < 1e6:
                raise InvalidArgument(f"{name} must not be negative, got {getattr(config, name)}")
        if not 0 < config.silent_after < 1e6:
            raise InvalidArgument(f"silent_after must be positive [s], got {config.silent_after}")
        if config.pixel_format not in get_args(PixelFormat):
            known = ", ".join(get_args(PixelFormat))
            raise InvalidArgument(f"pixel_format must be {known}, got {config.pixel_format}")
        self._config = config
        self._shape = (config.height, config.width, 3)
        self._pace = FramePace()
        self._cameras: list[NewestImage] = []
        count = len(self._sources)
        self.extended: dict[str, Any] = {
            "capture_time": np.int64,
            "times": (np.int64, (count,)),
            "errors": (np.int64, (count,)),
            "stamps": (np.int64, (count,)),
            "numbers": (np.int64, (count,)),
            "lost": (np.int64, (count,)),
            "valid": (np.bool_, (count,)),
            "reasons": {f"camera_{k}": CameraReason for k in range(count)},
            "images": (np.uint8, (count, config.height * config.width * 3)),
        }

    # ------------------------------------------------------------------ verbs

    def start(self) -> None:
        config = self._config
        aravis.function("arv_get_n_devices", int)  # raises if the library is missing
        settings = aravis.Settings(
            pixel_format=config.pixel_format,
            region=(config.left, config.top, config.width, config.height),
            rate=config.rate,
            exposure=config.exposure,
            trigger=config.trigger,
        )
        self._arrived = Condition()
        self._cameras = [
            NewestImage(name, settings, config.latency, self._arrived) for name in self._sources
        ]

    def write(self, desired: Desired) -> None:
        self._pace.period = round(desired.period * SECOND)

    def wait(self, due: int) -> None:
        self._pace.wait(due, self._images_arrive)

    def _images_arrive(self, deadline: int) -> bool:
        left = (deadline - time.monotonic_ns()) / SECOND
        with self._arrived:
            return self._arrived.wait_for(lambda: all(c.has_new for c in self._cameras), left)

    def read(self, reading: Reading) -> None:
        now, gap = time.monotonic_ns(), round(self._config.silent_after * SECOND)
        row = reading.extended
        for k, camera in enumerate(self._cameras):
            taken, reason = camera.take(now, gap)
            row["valid"][k] = taken is not None
            row["reasons"][f"camera_{k}"] = reason
            row["lost"][k] = camera.lost
            row["times"][k] = 0 if taken is None else taken.capture.time
            row["errors"][k] = 0 if taken is None else taken.capture.error
            row["stamps"][k] = 0 if taken is None else taken.stamp
            row["numbers"][k] = 0 if taken is None else taken.number
            into = row["images"][k]
            if taken is None:
                into[...] = 0  # never an old image
            else:
                into.reshape(self._shape)[...] = taken.image
        row["capture_time"] = row["times"].max()

    def stop(self) -> None:
        for camera in self._cameras:
            camera.end()
        for camera in self._cameras:
            camera.close()
