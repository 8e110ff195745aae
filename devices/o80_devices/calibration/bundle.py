"""Estimates camera places from common sightings, up to a common motion and scale."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from o80.base.arrays import FloatArray
from o80.base.extras import needed
from o80.errors import InvalidArgument
from o80_devices import _vision
from o80_devices.calibration.board import PURPOSE, opencv
from o80_devices.cameras.rig import RigCamera

MIN_SHARED = 20
"""Least number of moments in which two cameras see the waved ball together."""


def first_places(lenses: Sequence[RigCamera], waved: FloatArray) -> list[RigCamera]:
    """Estimates rough places, in the frame of the first camera that is placed.

    The two cameras with most common moments are placed by their essential matrix, each other
    one by the points triangulated so far (perspective of n points).
    """
    cv2 = opencv()
    flat = [lens.moved(np.eye(3), np.zeros(3)) for lens in lenses]
    seen: NDArray[np.bool_] = np.asarray(np.isfinite(waved).all(-1))
    shared = seen.T.astype(int) @ seen.astype(int)
    np.fill_diagonal(shared, 0)
    first, second = (int(k) for k in np.unravel_index(np.argmax(shared), shared.shape))
    _enough(lenses, first, second, int(shared[first, second]))
    both = seen[:, first] & seen[:, second]
    a, b = _plane(flat[first], waved[both, first]), _plane(flat[second], waved[both, second])
    essential, inliers = cv2.findEssentialMat(a, b, np.eye(3), cv2.RANSAC, 0.999, 0.004)
    _, rotation, translation, _ = cv2.recoverPose(essential, a, b, np.eye(3), mask=inliers)
    placed = {first: flat[first], second: flat[second].moved(rotation, np.ravel(translation))}

    while len(placed) < len(lenses):
        known = sorted(placed)
        points = triangulated([placed[k] for k in known], waved[:, known])
        found = np.isfinite(points).all(1)
        counts = {k: int((found & seen[:, k]).sum()) for k in range(len(lenses)) if k not in placed}
        following = max(counts, key=lambda k: counts[k])
        _enough(lenses, first, following, counts[following])
        together = found & seen[:, following]
        _, turn, shift, _ = cv2.solvePnPRansac(
            points[together],
            _plane(flat[following], waved[together, following]),
            np.eye(3),
            None,
            reprojectionError=0.01,
        )
        placed[following] = flat[following].moved(cv2.Rodrigues(turn)[0], np.ravel(shift))
    return [placed[k] for k in range(len(lenses))]


def _enough(lenses: Sequence[RigCamera], a: int, b: int, count: int) -> None:
    if count < MIN_SHARED:
        raise InvalidArgument(
            f"{lenses[a].name} and {lenses[b].name} see the ball together in {count} moments, "
            f"{MIN_SHARED} are needed: wave it where both see it"
        )


def _plane(lens: RigCamera, pixels: FloatArray) -> FloatArray:
    """Projects pixels to the plane at distance 1, without distortion (n, 2)."""
    directions = lens.model().directions(np.ascontiguousarray(pixels))
    plane: FloatArray = np.ascontiguousarray(directions[:, :2] / directions[:, 2:])
    return plane


def adjusted(cameras: Sequence[RigCamera], waved: FloatArray) -> list[RigCamera]:
    """Fits the places of cameras and ball to all images (bundle adjustment)."""
    optimize: Any = needed("scipy.optimize", "cameras", PURPOSE, package="o80-devices")
    sparse: Any = needed("scipy.sparse", "cameras", PURPOSE, package="o80-devices")
    rotations: Any = needed(
        "scipy.spatial.transform", "cameras", PURPOSE, package="o80-devices"
    ).Rotation
    points = triangulated(cameras, waved)
    used = np.isfinite(points).all(1)
    points, waved = points[used], waved[used]
    seen: NDArray[np.bool_] = np.asarray(np.isfinite(waved).all(-1))
    count = len(cameras)

    def placed(numbers: FloatArray) -> list[RigCamera]:
        poses = numbers[: 6 * count].reshape(count, 6)
        return [
            camera.moved(rotations.from_rotvec(pose[:3]).as_matrix(), pose[3:])
            for camera, pose in zip(cameras, poses, strict=True)
        ]

    def residuals(numbers: FloatArray) -> FloatArray:
        places = numbers[6 * count :].reshape(-1, 3)
        apart = []
        for k, camera in enumerate(placed(numbers)):
            own = camera.model().project(np.ascontiguousarray(places[seen[:, k]]))[:, :2]
            apart.append(np.nan_to_num(own - waved[seen[:, k], k], nan=1e3).ravel())
        return np.concatenate(apart)

    # a residual depends on one camera and one point
    rows = sparse.lil_matrix((2 * int(seen.sum()), 6 * count + 3 * len(points)), dtype=int)
    row = 0
    for k in range(count):
        for i in np.flatnonzero(seen[:, k]):
            rows[row : row + 2, 6 * k : 6 * k + 6] = 1
            rows[row : row + 2, 6 * count + 3 * i : 6 * count + 3 * i + 3] = 1
            row += 2
    poses = [
        [*rotations.from_matrix(np.reshape(c.rotation, (3, 3))).as_rotvec(), *c.translation]
        for c in cameras
    ]
    begin = np.concatenate([np.ravel(poses), points.ravel()])
    found = optimize.least_squares(
        residuals, begin, jac_sparsity=rows, x_scale="jac", loss="soft_l1", max_nfev=60, ftol=1e-7
    )
    return placed(found.x)


def triangulated(cameras: Sequence[RigCamera], pixels: FloatArray) -> FloatArray:
    """Triangulates points: (n, cameras, 2) [px] => (n, 3) [m]; NaN if seen by fewer than two."""
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
