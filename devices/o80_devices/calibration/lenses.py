"""Calibrates the lenses of several cameras from pictures of a board, and stores them in a file."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from o80.base.arrays import FloatArray
from o80.base.finite import json_text
from o80.errors import InvalidArgument, TimeoutError
from o80_devices.calibration.board import (
    MIN_PICTURES,
    Board,
    board_reprojection,
    lens_of,
    picture,
)
from o80_devices.cameras.image_source import ImageSource
from o80_devices.cameras.rig import RigCamera, with_tuples

FORMAT = "o80-ball-lenses-1"
EVERY = 4
"""Every fourth picture is held out."""
MIN_FOUND = 11
"""Least number of pictures with the board: 8 to fit, the others held out."""
NEW_PLACE = 0.015
"""Least mean motion of the corners between two counted pictures, as a share of the image."""


@dataclass(frozen=True)
class Lens:
    """A camera without a place, and its residuals."""

    camera: RigCamera
    fitted: float
    """Root mean square residual in the fitted pictures [px]."""
    held_out: float
    """Root mean square residual in the held-out pictures [px]."""
    pictures: int
    """Number of pictures in which the board was found."""


def lens_from_boards(
    name: str, size: tuple[int, int], boards: Sequence[FloatArray], board: Board, of: int
) -> Lens:
    """Fits a lens. of: number of searched pictures. Raises InvalidArgument for too few boards."""
    if len(boards) < MIN_FOUND:
        columns, rows = board.inner_corners
        raise InvalidArgument(
            f"the board of {columns} x {rows} inner corners was found in {len(boards)} of {of} "
            f"pictures of {name}: {MIN_FOUND} are needed ({MIN_PICTURES} to fit the lens, "
            "the others to test it). Count the inner corners, show the whole board, avoid blur"
        )
    fit = [each for i, each in enumerate(boards) if i % EVERY != EVERY - 1]
    out = [each for i, each in enumerate(boards) if i % EVERY == EVERY - 1]
    camera, residual = lens_of(name, size, fit, board)
    return Lens(camera, residual, board_reprojection(camera, out, board), len(boards))


def lens_from_files(name: str, files: Sequence[Path], board: Board) -> Lens:
    """Fits a lens to pictures. Raises InvalidArgument if size or boards do not allow it."""
    boards, size = [], None
    for file in files:
        image = picture(file)
        height, width = image.shape[:2]
        if size is None:
            size = (width, height)
        if (width, height) != size:
            raise InvalidArgument(
                f"{file} has {width} x {height} pixels, the pictures before it have "
                f"{size[0]} x {size[1]}: a lens is calibrated for one size of images"
            )
        found = board.found(image)
        if found is not None:
            boards.append(found)
    assert size is not None
    return lens_from_boards(name, size, boards, board, of=len(files))


def boards_from_segments(
    source: ImageSource,
    cameras: Sequence[RigCamera],
    board: Board,
    count: int,
    *,
    patience: float = 60.0,
    say: Callable[[str], None] = lambda text: None,
) -> list[list[FloatArray]]:
    """Collects boards at `count` different places for each camera.

    patience: timeout of the next board [s]. say: receives progress texts. Raises TimeoutError.
    """
    boards: list[list[FloatArray]] = [[] for _ in cameras]
    last = time.monotonic()
    while any(len(found) < count for found in boards):
        source.wait(0.05)
        images = source.read()
        for camera, found, image in zip(
            cameras, boards, images.images if images else [None] * len(cameras), strict=True
        ):
            if image is None or len(found) >= count:
                continue
            corners = board.found(image)
            if corners is not None and _is_new(corners, found, camera.size):
                found.append(corners)
                last = time.monotonic()
                say(f"boards found: {' '.join(str(len(each)) for each in boards)} of {count}")
        if time.monotonic() - last > patience:
            few = min(zip(boards, cameras, strict=True), key=lambda pair: len(pair[0]))
            raise TimeoutError(
                f"for {patience:g} s no camera has seen the board at a new place, and "
                f"{few[1].name} has seen it {len(few[0])} times of {count}: do the cameras run, "
                "does the board fit into the image, and are its inner corners counted?"
            )
    return boards


def _is_new(corners: FloatArray, before: Sequence[FloatArray], size: tuple[int, int]) -> bool:
    return all(np.abs(corners - each).mean() > NEW_PLACE * max(size) for each in before)


def save(lenses: Sequence[Lens], path: Path | str) -> None:
    cameras = [asdict(lens.camera) for lens in lenses]
    for camera in cameras:
        del camera["rotation"], camera["translation"]
    Path(path).write_text(json_text({"format": FORMAT, "cameras": cameras}, indent=1) + "\n")


def load(path: Path | str) -> list[RigCamera]:
    """Reads the lenses of a file. Raises InvalidArgument if it holds none."""
    try:
        content = json.loads(Path(path).read_text())
        if not isinstance(content, dict) or content.get("format") != FORMAT:
            raise InvalidArgument(f'"format" must be "{FORMAT}": make it with `calibrate lenses`')
        cameras = [RigCamera(**with_tuples(each)) for each in content["cameras"]]
        for camera in cameras:
            camera.model()
        names = [camera.name for camera in cameras]
        if len(set(names)) < len(names) or not names:
            raise InvalidArgument("each camera must have a different name")
    except (OSError, KeyError, TypeError, ValueError) as error:
        raise InvalidArgument(f"the lenses {path} cannot be used: {error}") from error
    return cameras
