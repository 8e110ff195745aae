"""Lenses from a board, places of cameras from a waved ball and the corners of the table."""

import numpy as np
import pytest
from numpy.typing import NDArray

import o80
from o80_devices.ball_tracking import Rig, four_cameras
from o80_devices.ball_tracking.calibration import (
    Calibrated,
    lens_from_board,
    places_from_ball,
    reprojection,
    triangulated,
    without_place,
)

FloatArray = NDArray[np.float64]
RIG = four_cameras()


def seen_by_all(rig: Rig, points: FloatArray, noise: float, seed: int) -> FloatArray:
    """(n, cameras, 2) [px]; NaN outside of an image."""
    random = np.random.default_rng(seed)
    pixels = np.stack([camera.project(points)[:, :2] for camera in rig.models()], axis=1)
    outside = ~((pixels >= 0) & (pixels < (640, 480))).all(-1)
    pixels[outside] = np.nan
    return pixels + noise * random.standard_normal(pixels.shape)


def waved(count: int, seed: int) -> FloatArray:
    random = np.random.default_rng(seed)
    return random.uniform([-0.6, 0.2, 0.8], [1.4, 2.9, 1.7], (count, 3))


@pytest.fixture(scope="module")
def calibrated() -> Calibrated:
    assert RIG.table is not None
    corners = RIG.table.corners
    pixels = np.moveaxis(seen_by_all(RIG, corners, 0.3, seed=4), 1, 0)
    lenses = [without_place(camera) for camera in RIG.cameras]
    return places_from_ball(lenses, seen_by_all(RIG, waved(150, 1), 0.3, seed=2), corners, pixels)


def test_a_waved_ball_places_the_cameras(calibrated: Calibrated) -> None:
    held_out = waved(200, 7)
    exact = seen_by_all(RIG, held_out, 0.0, seed=0)
    assert reprojection(calibrated.cameras, exact) < 0.3
    apart = np.linalg.norm(triangulated(calibrated.cameras, exact) - held_out, axis=1)
    assert np.nanmean(apart) < 0.005
    assert np.isfinite(apart).sum() > 150


def test_it_fits_as_well_as_the_noise_allows(calibrated: Calibrated) -> None:
    assert 0.2 < calibrated.residual < 0.45
    for found, true in zip(calibrated.cameras, RIG.cameras, strict=True):
        assert np.linalg.norm(found.place - true.place) < 0.02


def test_too_little_seen_together_is_refused() -> None:
    pixels = seen_by_all(RIG, waved(10, 1), 0.0, seed=0)
    with pytest.raises(o80.InvalidArgument, match="see the ball together in"):
        places_from_ball(RIG.cameras, pixels, np.zeros((4, 3)), np.zeros((4, 4, 2)))


def board_picture(turn: FloatArray, shift: FloatArray) -> NDArray[np.uint8]:
    """A chessboard of 10 x 7 squares of 3 cm, seen through the lens of the first camera."""
    lens = without_place(RIG.cameras[0])
    x, y = np.meshgrid(np.arange(640.0), np.arange(480.0))
    seen = np.zeros((480, 640))
    for dx in (-0.25, 0.25):  # smooth borders
        for dy in (-0.25, 0.25):
            pixels = np.stack([x.ravel() + dx, y.ravel() + dy], axis=1)
            rays = lens.model().directions(pixels)
            depth = (turn[:, 2] @ shift) / (rays @ turn[:, 2])
            on_board = (depth[:, np.newaxis] * rays - shift) @ turn[:, :2] / 0.03
            inside = ((on_board >= 0) & (on_board < (10, 7))).all(1)
            dark = inside & (np.floor(np.nan_to_num(on_board)).sum(1) % 2 == 0)
            seen += np.where(dark, 10.0, 60.0).reshape(480, 640)
    return np.repeat(seen.astype(np.uint8)[..., np.newaxis], 3, axis=-1)


@pytest.mark.check
def test_a_board_gives_the_lens() -> None:
    import cv2

    random = np.random.default_rng(3)
    pictures = []
    for i in range(14):
        turn = np.asarray(cv2.Rodrigues(random.uniform(-0.5, 0.5, 3))[0], np.float64)
        middle = np.array([0.1 * (i % 3 - 1), 0.07 * (i // 3 % 3 - 1), 0.42])
        pictures.append(board_picture(turn, middle - turn @ np.array([0.15, 0.105, 0])))
    found = lens_from_board("first", pictures, (9, 6), 0.03)
    true, lens = RIG.cameras[0], found.cameras[0]
    assert found.residual < 0.3
    assert np.allclose(lens.focal, true.focal, rtol=0.01)
    assert np.allclose(lens.centre, true.centre, atol=5.0)
    corner = np.array([[20.0, 20.0], [620.0, 20.0], [600.0, 460.0]])
    rays = without_place(lens).model().directions(corner)
    assert np.abs(rays - without_place(true).model().directions(corner)).max() < 0.01
    with pytest.raises(o80.InvalidArgument, match="at least 8"):
        lens_from_board("first", pictures[:3], (9, 6), 0.03)
