"""Calibrates the places of cameras from a waved ball. lenses.py has the lenses.

Simultaneous images of a ball waved through the room determine the relative places of the cameras,
up to a scale. The corners of the table, marked in the
images, then determine the scale and the world frame. Needs the extra `cameras`.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from o80.base.arrays import FloatArray
from o80.errors import InvalidArgument
from o80_devices.calibration.bundle import adjusted, first_places, triangulated
from o80_devices.calibration.waved_ball import check_motion
from o80_devices.calibration.world_frame import in_world
from o80_devices.cameras.rig import RigCamera

MIN_DEPTH = 0.02
"""Least ratio of the smallest extent of the ball's places to the largest one."""


def places_from_ball(
    lenses: Sequence[RigCamera],
    waved: FloatArray,
    corners: FloatArray,
    corner_pixels: FloatArray,
) -> tuple[RigCamera, ...]:
    """Returns cameras with known lenses at their places in the world.

    waved: (moments, cameras, 2) the ball in each image [px]; NaN: not seen.
    corners: (n, 3) of the table in the world [m], at least 3, at one height, not in one line.
    corner_pixels: (cameras, n, 2) the corners in each image [px]; NaN: not seen. Only corners
    seen by at least two cameras count.
    Raises InvalidArgument for too little motion or wrong corners, MissingExtra.
    """
    check_motion(lenses, waved)
    cameras = adjusted(first_places(lenses, waved), waved)
    _check_depth(cameras, waved)
    marks = np.moveaxis(corner_pixels, 0, 1)
    seen = triangulated(cameras, marks)
    known: NDArray[np.bool_] = np.asarray(np.isfinite(seen).all(1))
    _check_corners(lenses, marks, known)
    return in_world(cameras, seen[known], corners[known])


def _check_depth(cameras: Sequence[RigCamera], waved: FloatArray) -> None:
    """Raises InvalidArgument if the ball stayed in a plane: places are then ambiguous."""
    points = triangulated(cameras, waved)
    points = points[np.isfinite(points).all(1)]
    extents = np.linalg.svd(points - points.mean(0), compute_uv=False) if len(points) > 3 else None
    if extents is None or not extents[2] > MIN_DEPTH * extents[0]:
        raise InvalidArgument(
            "the ball was waved in a plane, which does not determine the places of the cameras: "
            "wave it in all three directions"
        )


def _check_corners(
    lenses: Sequence[RigCamera], marks: FloatArray, known: NDArray[np.bool_]
) -> None:
    by_two = np.isfinite(marks).all(-1).sum(1) >= 2
    if by_two.sum() < 3:
        raise InvalidArgument(
            f"{by_two.sum()} corners of the table are seen by two cameras or more: 3 are needed"
        )
    if (by_two & ~known).any():
        corner = int(np.flatnonzero(by_two & ~known)[0])
        by = [lens.name for lens, mark in zip(lenses, marks[corner], strict=True) if mark[0] >= 0]
        raise InvalidArgument(
            f"corner {corner} is marked at different places of the room by {', '.join(by)}: the "
            "corners must have the same order in all images"
        )


def reprojection(cameras: Sequence[RigCamera], pixels: FloatArray) -> float:
    """Root mean square reprojection error of points that two cameras or more see [px]."""
    points = triangulated(cameras, pixels)
    squares = []
    for k, camera in enumerate(cameras):
        both = np.isfinite(points).all(1) & np.isfinite(pixels[:, k]).all(1)
        seen = camera.model().project(np.ascontiguousarray(points[both]))[:, :2]
        squares.append(((seen - pixels[both, k]) ** 2).sum(1))
    return float(np.sqrt(np.mean(np.concatenate(squares))))


def left_out_distances(cameras: Sequence[RigCamera], pixels: FloatArray) -> FloatArray:
    """Distances by which the triangulated points move when one camera is left out [m].

    Covers each point that three cameras or more see, once for each of them.
    """
    whole = triangulated(cameras, pixels)
    moved = []
    for k in range(len(cameras)):
        others = pixels.copy()
        others[:, k] = np.nan
        moved.append(np.linalg.norm(triangulated(cameras, others) - whole, axis=1))
        moved[-1][~np.isfinite(pixels[:, k]).all(1)] = np.nan
    distances = np.concatenate(moved)
    kept: FloatArray = distances[np.isfinite(distances)]
    return kept
