"""Calibration of a rig: lenses from pictures of a board, places from a waved ball.

A ball waved through the room, seen by all cameras at the same moments, tells where the cameras are
relative to each other, except for the size of everything. The corners of the table, marked in the
images, then give the size and the frame of the world. Needs the extra `cameras`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from o80.errors import InvalidArgument
from o80.extras import needed
from o80_devices import _vision
from o80_devices.ball_tracking.rig import RigCamera

FloatArray = NDArray[np.float64]
Image = NDArray[np.uint8]
PURPOSE = "the calibration of cameras"
LEAST_SHARED = 20
"""Moments in which two cameras must see the waved ball together."""


@dataclass(frozen=True)
class Calibrated:
    """Cameras, and how well they fit what they were made from."""

    cameras: tuple[RigCamera, ...]
    residual: float
    """Root mean square in the images [px]."""


def lens_from_board(
    name: str, images: Sequence[Image], inner_corners: tuple[int, int], square: float
) -> Calibrated:
    """Focal lengths, centre and distortion from at least 8 pictures of a chessboard.

    inner_corners: how many along a row and along a column. square: length of a side [m].
    Raises InvalidArgument, MissingExtra.
    """
    cv2: Any = needed("cv2", "cameras", PURPOSE, package="o80-devices")
    columns, rows = inner_corners
    board = np.zeros((columns * rows, 3), np.float32)
    board[:, :2] = square * np.mgrid[:columns, :rows].T.reshape(-1, 2)
    places, corners = [], []
    for image in images:
        grey = np.ascontiguousarray(np.asarray(image).mean(-1).astype(np.uint8))
        found, pixels = cv2.findChessboardCorners(grey, inner_corners)
        if found:
            end = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 30, 0.001)
            corners.append(cv2.cornerSubPix(grey, pixels, (5, 5), (-1, -1), end))
            places.append(board)
    if len(corners) < 8:
        raise InvalidArgument(
            f"the board of {columns} x {rows} inner corners was found in {len(corners)} of "
            f"{len(images)} pictures of {name}: at least 8 are needed, from different sides"
        )
    height, width = images[0].shape[:2]
    residual, matrix, lens, _, _ = cv2.calibrateCamera(places, corners, (width, height), None, None)
    k1, k2, p1, p2, k3 = (float(value) for value in np.ravel(lens)[:5])
    camera = RigCamera(
        name=name,
        size=(width, height),
        focal=(float(matrix[0, 0]), float(matrix[1, 1])),
        centre=(float(matrix[0, 2]), float(matrix[1, 2])),
        distortion=(k1, k2, p1, p2, k3),
    )
    return Calibrated((camera,), float(residual))


def places_from_ball(
    lenses: Sequence[RigCamera],
    waved: FloatArray,
    corners: FloatArray,
    corner_pixels: FloatArray,
) -> Calibrated:
    """The places of cameras whose lenses are known.

    waved: (moments, cameras, 2) where each saw the ball [px]; NaN: not at all.
    corners: (n, 3) in the world [m], at least 3, not in one line.
    corner_pixels: (cameras, n, 2) where each sees them [px]; NaN: not at all. Each corner that
        counts is seen by at least two cameras.
    Raises InvalidArgument, MissingExtra.
    """
    from o80_devices.ball_tracking import bundle

    waved = np.asarray(waved, float)
    if waved.shape[1:] != (len(lenses), 2):
        raise InvalidArgument(
            f"waved must have the shape (moments, {len(lenses)}, 2), got {waved.shape}"
        )
    cameras = bundle.adjusted(bundle.first_places(lenses, waved), waved)
    seen = triangulated(cameras, np.moveaxis(np.asarray(corner_pixels, float), 0, 1))
    known = np.isfinite(seen).all(1)
    if known.sum() < 3:
        raise InvalidArgument(
            f"{known.sum()} corners of the table are seen by two cameras or more: 3 are needed"
        )
    cameras = _in_world(cameras, seen[known], np.asarray(corners, float)[known])
    return Calibrated(tuple(cameras), reprojection(cameras, waved))


def triangulated(cameras: Sequence[RigCamera], pixels: FloatArray) -> FloatArray:
    """(n, cameras, 2) [px] => (n, 3) [m]; NaN where fewer than two cameras see the point."""
    models = [camera.model() for camera in cameras]
    points = np.full((len(pixels), 3), np.nan)
    for i, row in enumerate(pixels):
        seen = [(k, x, y, 0.0) for k, (x, y) in enumerate(row) if np.isfinite(x)]
        if len(seen) < 2:
            continue
        found = _vision.locate(models, np.array(seen), tolerance=20.0, least=len(seen))
        if found is not None:
            points[i] = found[0]
    return points


def reprojection(cameras: Sequence[RigCamera], pixels: FloatArray) -> float:
    """Root mean square of the distances in the images [px], of points seen by two or more."""
    points = triangulated(cameras, pixels)
    squares = []
    for k, camera in enumerate(cameras):
        both = np.isfinite(points).all(1) & np.isfinite(pixels[:, k]).all(1)
        seen = camera.model().project(np.ascontiguousarray(points[both]))[:, :2]
        squares.append(((seen - pixels[both, k]) ** 2).sum(1))
    return float(np.sqrt(np.mean(np.concatenate(squares))))


def _in_world(cameras: Sequence[RigCamera], seen: FloatArray, known: FloatArray) -> list[RigCamera]:
    """Cameras moved, turned and scaled so that the points seen come to the known ones (Umeyama)."""
    seen_middle, known_middle = seen.mean(0), known.mean(0)
    apart, wanted = seen - seen_middle, known - known_middle
    left, sizes, right = np.linalg.svd(wanted.T @ apart)
    if sizes[1] < 1e-6 * sizes[0]:
        raise InvalidArgument("the corners lie in one line: they give no frame of the world")
    mirror = np.array([1.0, 1.0, np.sign(np.linalg.det(left @ right))])
    turn = left @ np.diag(mirror) @ right
    scale = float((sizes * mirror).sum() / (apart**2).sum())
    moved = []
    for camera in cameras:
        # world = scale turn (own - seen_middle) + known_middle
        rotation = np.reshape(camera.rotation, (3, 3)) @ turn.T
        place = scale * turn @ (camera.place - seen_middle) + known_middle
        moved.append(camera.moved(rotation, -rotation @ place))
    return moved


def without_place(camera: RigCamera) -> RigCamera:
    """The lens alone."""
    return replace(camera, rotation=tuple(np.eye(3).ravel().tolist()), translation=(0.0, 0.0, 0.0))
