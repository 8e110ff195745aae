"""Estimates scale, direction and origin of a rig from points with known places in the world."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from o80.base.arrays import FloatArray
from o80.errors import InvalidArgument
from o80_devices.cameras.rig import RigCamera
from o80_devices.motion_capture.transform import rotation_between

WORST_FIT = 0.02
"""Largest distance of a point from its known place, as a share of the extent of all points."""


@dataclass(frozen=True)
class Similarity:
    """p_world = scale rotation p + translation."""

    scale: float
    rotation: FloatArray
    translation: FloatArray

    @classmethod
    def between(cls, seen: FloatArray, known: FloatArray) -> Similarity:
        """Fits the similarity from seen points (n, 3) to known ones.

        Raises InvalidArgument for points on a line.
        """
        found = rotation_between(seen, known)
        if found is None:
            raise InvalidArgument("the corners lie in one line: they give no frame of the world")
        rotation, scale = found
        return cls(scale, rotation, known.mean(0) - scale * rotation @ seen.mean(0))

    def of_points(self, points: FloatArray) -> FloatArray:
        moved: FloatArray = self.scale * points @ self.rotation.T + self.translation
        return moved

    def of_camera(self, camera: RigCamera) -> RigCamera:
        rotation = np.reshape(camera.rotation, (3, 3)) @ self.rotation.T
        return camera.moved(rotation, -rotation @ self.of_points(camera.place))


def in_world(
    cameras: Sequence[RigCamera], seen: FloatArray, known: FloatArray
) -> tuple[RigCamera, ...]:
    """Moves, turns and scales the cameras so that the seen points match the known ones.

    known: points at one height.
    Raises InvalidArgument if the points do not fit, or if they are mirrored.
    """
    similarity = Similarity.between(seen, known)
    away = np.linalg.norm(similarity.of_points(seen) - known, axis=1)
    size = float(np.linalg.norm(np.ptp(known, axis=0)))
    if not away.max() < WORST_FIT * size:
        raise InvalidArgument(
            f"the corners fit the table only within {1e3 * away.max():.0f} mm: check the order in "
            "which they are marked (counter-clockwise seen from above, from the smallest x and y) "
            "and the size of the table"
        )
    moved = tuple(similarity.of_camera(camera) for camera in cameras)
    _check_not_mirrored(moved, known)
    return moved


def _check_not_mirrored(cameras: Sequence[RigCamera], known: FloatArray) -> None:
    """Raises InvalidArgument for mirrored corners, which fit a rig that is upside down."""
    below = [camera.name for camera in cameras if camera.place[2] < known[:, 2].mean()]
    if below:
        raise InvalidArgument(
            f"{below[0]} would be below the table: the corners are mirrored. Mark them "
            "counter-clockwise seen from above, from the smallest x and y"
        )


def left_out_errors(seen: FloatArray, known: FloatArray) -> FloatArray:
    """Error of each point (n,) when the frame is fitted to the other points [m].

    Empty for fewer than four points.
    """
    if len(seen) < 4:
        return np.empty(0)
    errors = []
    for i in range(len(seen)):
        others = np.arange(len(seen)) != i
        similarity = Similarity.between(seen[others], known[others])
        errors.append(float(np.linalg.norm(similarity.of_points(seen[i]) - known[i])))
    return np.array(errors)
