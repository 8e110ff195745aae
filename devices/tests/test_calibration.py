"""Places of cameras from a waved ball and the corners of the table."""

import numpy as np
import pytest

import o80
from o80.base.arrays import FloatArray
from o80_devices.ball_tracking import Rig, four_cameras
from o80_devices.calibration.bundle import triangulated, without_place
from o80_devices.calibration.extrinsics import Calibrated, places_from_ball, reprojection

pytestmark = pytest.mark.check  # needs OpenCV, which only `make check` installs

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
