"""Reads simultaneous images of all cameras of a rig from their segments."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

import o80
from o80.base.arrays import Image
from o80_devices.attached import Attached
from o80_devices.cameras.rig import Rig, RigCamera


@dataclass(frozen=True)
class Images:
    """Images of one moment, one for each camera of the rig; None: no image."""

    images: list[Image | None]
    time: int
    """Time of capture [ns]."""
    error: int = 0
    """Estimated error of `time`, the largest of all cameras with an image [ns]; 0 if exact."""


class CameraSegment(Attached):
    """Segment with the images of one camera, or of several that capture simultaneously."""

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self._iteration = -1
        self.images: list[Image | None] = []
        self.time = 0
        self.error = 0

    def check(self, frontend: o80.Frontend) -> None:
        self._iteration = -1
        fields = frontend.latest().extended
        if "images" not in fields or "capture_time" not in fields:
            raise o80.InvalidArgument(
                f"the segment '{self._segment}' holds no images: its rows need the extended values "
                "'images' (cameras, bytes of an image) and 'capture_time'"
            )

    def wait(self, timeout: float) -> bool:
        """Waits for unread images. timeout: [s]. Returns False if none arrived."""
        if self._frontend is None:
            return False
        try:
            self._frontend.wait_for(self._iteration + 1, timeout=max(timeout, 0.0))
        except o80.RowOverwritten:
            return True
        except (o80.TimeoutError, o80.BackendGone):
            return False
        return True

    def read(self, now: int) -> bool:
        """Reads the newest row. Returns False if none is new. now: of any clock [ns]."""
        frontend, _ = self.frontend(now)
        if frontend is None or frontend.published == self._iteration:
            return False
        row = frontend.latest()
        self._iteration = row.iteration
        capture = int(row.extended["capture_time"])
        if capture == 0:  # a row without images
            return False
        images = np.asarray(row.extended["images"])
        self.images, self.time = list(np.atleast_2d(images)), capture
        if "valid" in row.extended:
            valid = np.atleast_1d(row.extended["valid"])
            pairs = zip(self.images, valid, strict=True)
            self.images = [image if new else None for image, new in pairs]
        self.error = int(np.max(row.extended["errors"])) if "errors" in row.extended else 0
        return True


class ImageSource:
    """Reads each segment's newest images; drops those older than the newest by more than `skew`.

    skew: longest time between images that count as simultaneous [s].
    """

    def __init__(self, segments: Sequence[str], rig: Rig, skew: float) -> None:
        self._segments = [CameraSegment(name) for name in segments]
        self._cameras = rig.cameras
        self._skew = round(skew * 1e9)

    def attach(self, timeout: float) -> None:
        """Attaches to all segments. Raises TimeoutError, or InvalidArgument without images."""
        for each in self._segments:
            each.attach(timeout)

    def wait(self, timeout: float) -> None:
        """Waits for images of the first segment, or until the timeout [s] has passed."""
        self.wait_until(time.monotonic_ns() + round(timeout * 1e9))

    def wait_until(self, deadline: int) -> bool:
        """Waits for images of the first segment until a deadline [ns]; returns whether any came."""
        came = self._segments[0].wait((deadline - time.monotonic_ns()) * 1e-9)
        if not came:
            time.sleep(max(0, deadline - time.monotonic_ns()) * 1e-9)
        return came

    def read(self) -> Images | None:
        """Returns unread images, or None. Raises InvalidArgument if they do not match the rig."""
        now = time.monotonic_ns()
        came = [each.read(now) for each in self._segments]
        if not any(came):
            return None
        newest = max(each.time for each, new in zip(self._segments, came, strict=True) if new)
        images: list[Image | None] = []
        for each, new in zip(self._segments, came, strict=True):
            together = new and abs(each.time - newest) <= self._skew
            images += each.images if together else [None] * max(1, len(each.images))
        if len(images) != len(self._cameras):
            raise o80.InvalidArgument(
                f"the rig has {len(self._cameras)} cameras, the segments have {len(images)}"
            )
        shaped = [self._shaped(*each) for each in zip(images, self._cameras, strict=True)]
        error = max(each.error for each, new in zip(self._segments, came, strict=True) if new)
        return Images(shaped, newest, error)

    def _shaped(self, image: Image | None, camera: RigCamera) -> Image | None:
        if image is None:
            return None
        width, height = camera.size
        if image.size != height * width * 3:
            raise o80.InvalidArgument(
                f"images of {camera.name} must have {width} x {height} pixels of 3 bytes as in the "
                f"rig, got {image.size} bytes"
            )
        return image.reshape(height, width, 3)

    def close(self) -> None:
        for each in self._segments:
            each.close()
