"""Tracks the ball from the images of one moment: detection, place, flight. No o80, no clock."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from o80.base.arrays import FloatArray, Image
from o80.errors import InvalidArgument
from o80_devices import _vision
from o80_devices.ball_tracking import colour
from o80_devices.ball_tracking.ball_row import Reason
from o80_devices.ball_tracking.detection import Detector
from o80_devices.ball_tracking.flight_track import FlightTrack, Tracked
from o80_devices.cameras.rig import Rig


@dataclass(frozen=True)
class TrackerOptions:
    """Options of the tracker."""

    tolerance: float = 3.0
    """Largest distance between a detection and the common place, as seen in the image [px]."""
    noise: float = 0.3
    """Standard deviation of a detection [px]."""
    least: int = 2
    """Cameras that must agree while a ball is tracked."""
    least_to_begin: int = 3
    """Cameras that must agree on a new ball or on a hit, if the rig has so many."""
    forget: float = 0.3
    """Time without a sighting after which the next sighting starts a new ball [s]."""

    def __post_init__(self) -> None:
        """Raises InvalidArgument."""
        for name in ("tolerance", "noise"):
            if not 1e-6 <= getattr(self, name) <= 1e6:
                raise InvalidArgument(
                    f"{name} must be from 1e-06 to 1e+06 px, got {getattr(self, name):g}"
                )


class Tracker:
    """Tracks one ball at a time."""

    def __init__(
        self,
        rig: Rig,
        colours: NDArray[np.uint8] | None = None,
        options: TrackerOptions | None = None,
    ) -> None:
        rig.check()
        self.options = options or TrackerOptions()
        self.cameras = rig.models()
        self._radius = rig.flight.radius
        self._detector = Detector(rig, colour.of_hue() if colours is None else colours)
        self._track = FlightTrack(rig.law(), self.options.forget)
        self.sightings: FloatArray = np.empty((0, 4))
        """Sightings in the last images: camera, x and y [px], area [px^2]."""

    def forget(self) -> None:
        """Forgets the ball: the next sighting starts a new one."""
        self._track.forget()

    def track(self, images: Sequence[Image | None], time: int) -> Tracked:
        """Finds the ball in images taken at one time [ns]; None: a camera has no image."""
        if len(images) != len(self.cameras):
            raise ValueError(f"{len(self.cameras)} images are needed, got {len(images)}")
        expected, spread = self._track.expected(time)
        self.sightings = self._detector.detect(images, expected, spread)
        return self.place(self.sightings, time)

    def place(self, sightings: FloatArray, time: int) -> Tracked:
        """Finds the ball from detections (n, 4): camera, x and y [px], area [px^2] (0: unknown)."""
        options = self.options
        to_begin = min(options.least_to_begin, len(self.cameras))
        expected, _ = self._track.expected(time)
        found, some = None, len(np.unique(sightings[:, 0])) >= 2
        if some:
            found = _vision.locate(
                self.cameras,
                np.ascontiguousarray(sightings),
                tolerance=options.tolerance,
                noise=options.noise,
                radius=self._radius,
                least=to_begin if expected is None else options.least,
                expected=expected,
            )
        if found is None:
            return self._track.lost(time, Reason.no_agreement if some else Reason.not_found)
        enough = found[2].bit_count() >= to_begin
        return self._track.seen(time, *found, may_surprise=enough)
