"""The driver that reads images from the segments of cameras and publishes the ball."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from o80.drivers import Reading, option
from o80_devices.ball_tracking import colour
from o80_devices.ball_tracking.ball_row import EXTENDED, UNITS, Reason
from o80_devices.ball_tracking.flight_track import Tracked
from o80_devices.ball_tracking.tracker import Tracker, TrackerOptions
from o80_devices.cameras.image_source import ImageSource
from o80_devices.cameras.rig import Rig, four_cameras

MAX_AHEAD = 4  # limit of the accumulated time by which images come early [periods]


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
        self._period = self._ahead = 0  # [ns]

    def start(self) -> None:
        segments = [name.strip() for name in self._config.cameras.split(",") if name.strip()]
        self._source = ImageSource(segments, self._rig, self._config.skew)
        self._source.attach(self._config.timeout)

    def wait(self, due: int) -> None:
        """Waits for new images, at most until a quarter of a period after `due` [ns]."""
        now = time.monotonic_ns()
        self._period = max(self._period, due - now)
        self._source.wait(max(0, due + self._period // 4 - now) * 1e-9)
        now = time.monotonic_ns()
        # cameras that catch up would drive the loop ahead of its clock, which is a fault: the
        # loop then waits for its own clock, and reads the newest images
        self._ahead = max(0, self._ahead + due - now)
        if self._ahead > MAX_AHEAD * self._period and due > now:
            time.sleep((due - now) * 1e-9)
            self._ahead -= due - now

    def read(self, reading: Reading) -> None:
        images = self._source.read(time.monotonic())
        if images is None:
            reading.missed()
            fill(reading, Tracked(reading.time, Reason.no_image), 0)
            return
        ball = self._tracker.track(images.images, images.time)
        fill(reading, ball, images.time, images.error)

    def on_forget(self, _fields: Mapping[str, Any]) -> None:
        self._tracker.forget()

    def stop(self) -> None:
        self._source.close()


def fill(reading: Reading, ball: Tracked, image_time: int, error: int = 0) -> None:
    """Writes the row. image_time: 0 without images [ns]. error: uncertainty of image_time [ns]."""
    row = reading.extended
    row["capture_error"] = error if ball.seen else 0
    row["capture_time"] = ball.time if ball.seen else 0
    row["reason"] = ball.reason
    row["ball"] = ball.ball
    for name in ("position", "velocity", "spin", "covariance", "measured", "residual"):
        row[name] = getattr(ball, name)
    row["error"] = ball.error if ball.seen else np.nan
    row["cameras"] = ball.cameras
    row["image_time"] = row["stamp"] = image_time
