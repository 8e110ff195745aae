"""The driver that reads images from the segments of cameras and publishes the ball."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from o80.drivers import Desired, Reading, option
from o80_devices.ball_tracking import colour
from o80_devices.ball_tracking.ball_row import EXTENDED, UNITS, Reason
from o80_devices.ball_tracking.flight_track import Tracked
from o80_devices.ball_tracking.tracker import Tracker, TrackerOptions
from o80_devices.cameras.image_source import ImageSource
from o80_devices.cameras.rig import Rig, four_cameras
from o80_devices.frame_pace import FramePace


class BallTracker:
    """Tracks the ball in the images of a rig; publishes one row for each moment with images.

    A row without a ball has capture_time 0, NaN for numbers, and the reason. The request
    `forget` starts a new ball, for example after a simulation has teleported its ball.
    """

    extended = EXTENDED
    units = UNITS
    requests: ClassVar[dict[str, dict[str, Any]]] = {"forget": {}}

    @dataclass
    class Config:
        cameras: str = option("synthetic_cameras", "segments with images, separated by commas")
        rig: str = option("", "file of the rig; without one, four cameras around a table")
        colours: str = option("", "file of the colours of the ball; without one, orange")
        tolerance: float = option(3.0, "of cameras that agree on a place", "px")
        noise: float = option(0.3, "standard deviation of a detection", "px")
        skew: float = option(0.002, "between images that count as taken together", "s")
        timeout: float = option(5.0, "for the cameras to appear at the start", "s")

    def __init__(self, config: Config) -> None:
        self._config = config
        self._rig = Rig.load(config.rig) if config.rig else four_cameras()
        colours = colour.load(config.colours) if config.colours else None
        options = TrackerOptions(tolerance=config.tolerance, noise=config.noise)
        self._tracker = Tracker(self._rig, colours, options)
        self._pace = FramePace()

    def start(self) -> None:
        segments = [name.strip() for name in self._config.cameras.split(",") if name.strip()]
        self._source = ImageSource(segments, self._rig, self._config.skew)
        self._source.attach(self._config.timeout)

    def write(self, desired: Desired) -> None:
        self._pace.period = round(desired.period * 1e9)

    def wait(self, due: int) -> None:
        self._pace.wait(due, self._source.wait_until)

    def read(self, reading: Reading) -> None:
        images = self._source.read()
        if images is None:
            reading.missed()
            ball, taken, error = Tracked(reading.time, Reason.no_image), 0, 0
        else:
            ball = self._tracker.track(images.images, images.time)
            taken, error = images.time, images.error
        reading.extended = ball.fields() | {
            "capture_error": error if ball.seen else 0,
            "reason": ball.reason,
            "covariance": ball.covariance,
            "cameras": ball.cameras,
            "residual": ball.residual,
            "image_time": taken,
            "stamp": taken,
        }

    def on_forget(self, _fields: Mapping[str, Any]) -> None:
        self._tracker.forget()

    def stop(self) -> None:
        self._source.close()
