"""Calibrates a lens from pictures of a chessboard. Needs the extra `cameras`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from o80.base.arrays import FloatArray, Image
from o80.base.extras import needed
from o80.errors import InvalidArgument
from o80_devices.cameras.rig import RigCamera

PURPOSE = "the calibration of cameras"
MIN_PICTURES = 8
"""Least number of pictures with the board to calibrate a lens."""
LARGEST_UNCERTAINTY = 0.02
"""Largest relative uncertainty of a focal length."""
MIN_TILT = 0.1
"""Least root mean square of the boards' tilt [rad]: boards that all face the camera do not
distinguish a long lens from a near board."""
SUFFIXES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".ppm", ".pgm")


@dataclass(frozen=True)
class Board:
    """A printed chessboard."""

    inner_corners: tuple[int, int]
    """Numbers of corners along a row and along a column, without the border."""
    square: float
    """Side of a square [m]."""

    def __post_init__(self) -> None:
        if min(self.inner_corners) < 3:
            raise InvalidArgument(
                f"a board needs at least 3 x 3 inner corners, got {self.inner_corners}"
            )
        if not 0.0 < self.square < 10.0:
            raise InvalidArgument(f"a side of a square must be positive [m], got {self.square}")

    def points(self) -> NDArray[np.float32]:
        """(n, 3) The inner corners in the frame of the board [m]."""
        columns, rows = self.inner_corners
        points = np.zeros((columns * rows, 3), np.float32)
        points[:, :2] = self.square * np.mgrid[:columns, :rows].T.reshape(-1, 2)
        return points

    def found(self, image: Image) -> FloatArray | None:
        """Finds the inner corners in an image (n, 2) [px]; None if it does not show them all."""
        cv2 = opencv()
        pixels = np.asarray(image)
        grey = np.ascontiguousarray(pixels.mean(-1).astype(np.uint8) if pixels.ndim > 2 else pixels)
        found, corners = cv2.findChessboardCorners(grey, self.inner_corners)
        if not found:
            return None
        end = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 30, 0.001)
        fine = cv2.cornerSubPix(grey, corners, (5, 5), (-1, -1), end)
        return np.asarray(fine, float).reshape(-1, 2)


def opencv() -> Any:
    """Imports and returns `cv2`. Raises MissingExtra if it is not installed."""
    return needed("cv2", "cameras", PURPOSE, package="o80-devices")


def lens_of(
    name: str, size: tuple[int, int], boards: Sequence[FloatArray], board: Board
) -> tuple[RigCamera, float]:
    """Fits a lens; returns it and its residual [px]. size: of the images. boards: corners (n, 2).

    Raises InvalidArgument if the boards do not determine the focal length.
    """
    points = [board.points()] * len(boards)
    corners = [each.astype(np.float32).reshape(-1, 1, 2) for each in boards]
    residual, matrix, bent, turns, _, deviations, _, _ = opencv().calibrateCameraExtended(
        points, corners, size, None, None
    )
    focal = (float(matrix[0, 0]), float(matrix[1, 1]))
    uncertain = float(np.max(np.ravel(deviations)[:2] / focal))
    if not (uncertain < LARGEST_UNCERTAINTY and _tilt(turns) > MIN_TILT):
        raise InvalidArgument(
            f"the pictures of {name} do not determine its focal length: the board is tilted by "
            f"{np.degrees(_tilt(turns)):.0f} degrees on average. Tilt it by 20 to 40 degrees to "
            "all sides, and fill the image with it"
        )
    k1, k2, p1, p2, k3 = (float(value) for value in np.ravel(bent)[:5])
    lens = RigCamera(
        name=name,
        size=size,
        focal=focal,
        centre=(float(matrix[0, 2]), float(matrix[1, 2])),
        distortion=(k1, k2, p1, p2, k3),
    )
    return lens, float(residual)


def _tilt(turns: Sequence[FloatArray]) -> float:
    """Root mean square angle between the board normals and the camera axis [rad]."""
    ahead = [abs(float(opencv().Rodrigues(turn)[0][2, 2])) for turn in turns]
    return float(np.sqrt(np.mean(np.arccos(np.minimum(ahead, 1.0)) ** 2)))


def board_reprojection(lens: RigCamera, boards: Sequence[FloatArray], board: Board) -> float:
    """Residual of a lens on boards that were not used in its fit; fits their poses [px]."""
    cv2, points = opencv(), board.points()
    matrix = np.array(
        [[lens.focal[0], 0, lens.centre[0]], [0, lens.focal[1], lens.centre[1]], [0, 0, 1]]
    )
    bent, squares = np.array(lens.distortion), []
    for corners in boards:
        _, turn, shift = cv2.solvePnP(points, corners, matrix, bent)
        seen, _ = cv2.projectPoints(points, turn, shift, matrix, bent)
        squares.append(((np.reshape(seen, (-1, 2)) - corners) ** 2).sum(1).mean())
    return float(np.sqrt(np.mean(squares)))


def pictures_of(folder: Path) -> dict[str, list[Path]]:
    """Lists the pictures of each camera's folder. Raises InvalidArgument if there are none."""
    if not folder.is_dir():
        raise InvalidArgument(
            f"{folder} is not a folder: give one that holds a folder of pictures for each camera"
        )
    found = {
        each.name: sorted(file for file in each.iterdir() if file.suffix.lower() in SUFFIXES)
        for each in sorted(folder.iterdir())
        if each.is_dir()
    }
    found = {name: files for name, files in found.items() if files}
    if not found:
        raise InvalidArgument(
            f"{folder} has no folders with pictures: put those of each camera into a folder with "
            f"its name, such as {folder / 'camera_0' / '01.png'}"
        )
    return found


def picture(file: Path) -> Image:
    """Reads a picture, red first. Raises InvalidArgument if that fails."""
    image = opencv().imread(str(file))
    if image is None:
        raise InvalidArgument(f"the picture {file} cannot be read")
    red_first: Image = np.ascontiguousarray(image[..., ::-1])
    return red_first
