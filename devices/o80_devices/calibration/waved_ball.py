"""Records the pixels at which each camera sees a ball that is waved through the room."""

from __future__ import annotations

import time
import zipfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from o80.base.arrays import FloatArray, Image
from o80.errors import InvalidArgument, TimeoutError
from o80_devices import _vision
from o80_devices.ball_tracking import colour
from o80_devices.cameras.image_source import ImageSource
from o80_devices.cameras.rig import RigCamera

NEW_PLACE = 6.0
"""Least motion of the ball in one image between two counted moments [px]."""
SECOND_BEST = 0.5
"""An image is ambiguous, and not counted, if its second blob has this share of the first's area."""
MIN_SPAN = 0.15
"""Least share of an image's width and height that the ball must cross."""
EVERY = 4
"""Every fourth moment is held out."""


@dataclass(frozen=True)
class WavedBall:
    """Moments in which at least two cameras see the ball."""

    names: tuple[str, ...]
    """Names of the cameras."""
    pixels: FloatArray
    """(moments, cameras, 2) [px]; NaN: not seen."""

    def save(self, path: Path | str) -> None:
        with Path(path).open("wb") as file:
            np.savez(file, names=np.array(self.names), pixels=self.pixels)

    @classmethod
    def load(cls, path: Path | str) -> WavedBall:
        """Reads a recording. Raises InvalidArgument if the file holds none."""
        try:
            with np.load(path, allow_pickle=False) as content:
                names = tuple(str(name) for name in content["names"])
                pixels = np.asarray(content["pixels"], float)
        except (OSError, ValueError, KeyError, EOFError, TypeError, zipfile.BadZipFile) as error:
            raise InvalidArgument(f"{path} is not a recording of a waved ball: {error}") from error
        if pixels.shape[1:] != (len(names), 2):
            raise InvalidArgument(
                f"{path}: 'pixels' must have the shape (moments, {len(names)}, 2), got "
                f"{pixels.shape}"
            )
        return cls(names, pixels)

    def of(self, names: Sequence[str]) -> WavedBall:
        """Selects cameras, in this order. Raises InvalidArgument if one is missing."""
        missing = [name for name in names if name not in self.names]
        if missing:
            raise InvalidArgument(
                f"the waved ball was not recorded by {missing[0]}, only by {', '.join(self.names)}"
            )
        order = [self.names.index(name) for name in names]
        return WavedBall(tuple(names), self.pixels[:, order])

    def parts(self) -> tuple[FloatArray, FloatArray]:
        """Splits the moments: those to fit, and every fourth one, which is held out."""
        out = np.arange(len(self.pixels)) % EVERY == EVERY - 1
        return self.pixels[~out], self.pixels[out]


def check_motion(lenses: Sequence[RigCamera], waved: FloatArray) -> None:
    """Raises InvalidArgument if the ball stayed in a small part of an image."""
    for k, lens in enumerate(lenses):
        seen = waved[np.isfinite(waved[:, k]).all(1), k]
        if len(seen) == 0:
            raise InvalidArgument(
                f"{lens.name} did not see the ball in any moment: wave it where it looks, or teach "
                "the colour of the ball (--colours)"
            )
        low, high = np.percentile(seen, [2, 98], axis=0)
        for name, share in zip(("width", "height"), (high - low) / lens.size, strict=True):
            if share < MIN_SPAN:
                raise InvalidArgument(
                    f"the ball crossed {100 * share:.0f} % of the {name} of the image of "
                    f"{lens.name}, {100 * MIN_SPAN:.0f} % are needed: wave it through the whole "
                    "space over the table, in all three directions"
                )


class BallFinder:
    """Finds the only ball in a whole image."""

    def __init__(self, colours: NDArray[np.uint8] | None = None) -> None:
        table = colour.of_hue() if colours is None else colours
        self._finder = _vision.BlobFinder(np.ascontiguousarray(table))

    def find(self, image: Image | None) -> tuple[float, float]:
        """Returns x and y [px]; NaN without a ball, or with two."""
        nowhere = (float("nan"), float("nan"))
        if image is None:
            return nowhere
        blobs = sorted(self._finder.find(image).tolist(), key=lambda blob: -float(blob[3]))
        if not blobs or blobs[0][4]:
            return nowhere
        if len(blobs) > 1 and blobs[1][3] > SECOND_BEST * blobs[0][3]:
            return nowhere
        return float(blobs[0][0]), float(blobs[0][1])


def collected(
    source: ImageSource,
    names: Sequence[str],
    moments: int,
    *,
    finder: BallFinder,
    patience: float = 30.0,
    say: Callable[[int], None] = lambda count: None,
) -> WavedBall:
    """Records `moments` moments from segments with images.

    patience: timeout of the next moment in which two cameras see the ball at a new place [s].
    say: receives the number of moments so far. Raises TimeoutError.
    """
    kept: list[FloatArray] = []
    last = time.monotonic()
    while len(kept) < moments:
        source.wait(0.05)
        images = source.read()
        if images is not None:
            seen = np.array([finder.find(image) for image in images.images])
            if _is_new(seen, kept[-1] if kept else None):
                kept.append(seen)
                last = time.monotonic()
                say(len(kept))
        if time.monotonic() - last > patience:
            raise TimeoutError(
                f"for {patience:g} s no two cameras have seen the ball at a new place "
                f"({len(kept)} of {moments} moments are there): do the cameras run, and is the "
                "colour of the ball known (--colours)?"
            )
    return WavedBall(tuple(names), np.array(kept))


def _is_new(seen: FloatArray, before: FloatArray | None) -> bool:
    there = np.isfinite(seen).all(1)
    if there.sum() < 2:
        return False
    if before is None:
        return True
    moved = np.linalg.norm(seen - before, axis=1)
    return not np.nanmax(np.append(moved, 0.0)) < NEW_PLACE or not np.isfinite(moved).any()
