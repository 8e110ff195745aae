"""Search regions in the images of all cameras, and detections inside them.

While a ball is tracked, the expected place of the ball is searched in each image. Otherwise the
earlier detections are searched, and one camera at a time searches the whole image at every
third pixel of every third row.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from o80.base.arrays import FloatArray, Image
from o80_devices import _vision
from o80_devices.cameras.rig import Rig

STEP = 3
"""Step of a search of a whole image [px]."""
AROUND = 24
"""Margin around a region, added for the ball's size and uncertainty [px]."""
LARGEST = 120
"""Limit of half a region's side [px]."""
MAX_PLACES = 3
"""Largest number of places that are searched again in the next image."""


class Detector:
    """Finds candidates of the ball in the images of all cameras."""

    def __init__(self, rig: Rig, colours: NDArray[np.uint8]) -> None:
        self._cameras = rig.models()
        self._sizes = [camera.size for camera in rig.cameras]
        self._names = [camera.name for camera in rig.cameras]
        self._focal = [max(camera.focal) for camera in rig.cameras]
        self._radius = rig.flight.radius
        self._finder = _vision.BlobFinder(np.ascontiguousarray(colours))
        self._places: list[list[tuple[float, float]]] = [[] for _ in self._cameras]
        self._next = 0

    def detect(
        self, images: Sequence[Image | None], expected: FloatArray | None, spread: float
    ) -> FloatArray:
        """Returns (n, 4): camera, x and y [px], area [px^2]. spread: error of `expected` [m]."""
        searching = self._next if expected is None else None
        if expected is None:
            self._next = (self._next + 1) % len(self._cameras)
        found: list[tuple[float, float, float, float]] = []
        for index, image in enumerate(images):
            if image is None:
                continue
            self._check(index, image)
            regions = self._regions(index, image, expected, spread, searching == index)
            blobs = self._blobs(image, regions)
            self._places[index] = [(blob[1], blob[2]) for blob in blobs[:MAX_PLACES]]
            found += [(index, *blob[1:]) for blob in blobs]
        return np.array(found, dtype=float).reshape(-1, 4)

    def _check(self, index: int, image: Image) -> None:
        width, height = self._sizes[index]
        if image.shape != (height, width, 3):
            raise ValueError(
                f"the image of {self._names[index]} has the shape {image.shape}, but the rig has "
                f"{(height, width, 3)}"
            )

    def _regions(
        self,
        index: int,
        image: Image,
        expected: FloatArray | None,
        spread: float,
        searches: bool,
    ) -> list[tuple[int, int, int, int]]:
        if expected is not None:
            x, y, depth = self._cameras[index].project(expected[np.newaxis])[0]
            if not np.isfinite(x):
                return []
            per_metre = self._focal[index] / depth
            half = AROUND + (4 * spread + 3 * self._radius) * per_metre
            return [_square(x, y, min(half, LARGEST))]
        places = self._places[index]
        if searches:
            coarse = self._finder.find(image, step=STEP, min_area=1.0)
            places = [(x, y) for x, y, *_ in coarse[:MAX_PLACES]] + places
        # drops places that both the search and the previous image found
        kept: list[tuple[float, float]] = []
        for x, y in places:
            if all(abs(x - a) + abs(y - b) > AROUND for a, b in kept):
                kept.append((x, y))
        return [_square(x, y, 2 * AROUND) for x, y in kept[:MAX_PLACES]]

    def _blobs(
        self, image: Image, regions: list[tuple[int, int, int, int]]
    ) -> list[tuple[float, float, float, float]]:
        """Returns weight, x, y and area of the blobs, largest weight first, without duplicates."""
        found: list[tuple[float, float, float, float]] = []
        for region in regions:
            for x, y, area, weight, cut in self._finder.find(image, region).tolist():
                known = any(abs(x - b[1]) + abs(y - b[2]) < 2 for b in found)
                if not cut and not known:
                    found.append((weight, x, y, area))
        return sorted(found, reverse=True)


def _square(x: float, y: float, half: float) -> tuple[int, int, int, int]:
    return int(x - half), int(y - half), int(x + half) + 1, int(y + half) + 1
