"""Cameras by OpenCV, played from films."""

import os
from pathlib import Path

import numpy as np
import pytest

import o80
from o80_devices.ball_tracking import BallTracker, Reason, VideoCameras, four_cameras
from o80_devices.cameras.scene import Scene
from o80_devices.cameras.throws import Throws

pytestmark = pytest.mark.check  # needs OpenCV, which only `make check` installs

RATE = 180


@pytest.fixture(scope="module")
def films(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """A fifth of a second of a flight, a film for each camera."""
    import cv2

    folder, rig = tmp_path_factory.mktemp("films"), four_cameras()
    scene, throws = Scene(rig, variations=1), Throws(rig, 1)
    paths = [folder / f"{camera.name}.avi" for camera in rig.cameras]
    for k, path in enumerate(paths):
        code = cv2.VideoWriter.fourcc(*"MJPG")
        film = cv2.VideoWriter(str(path), code, 30, (640, 480))
        for i in range(36):
            ball = throws.at(0.3 + i / RATE)
            film.write(scene.image(k, ball.position, ball.velocity)[..., ::-1])
        film.release()
    return paths


def test_the_ball_of_four_films_is_tracked(films: list[Path]) -> None:
    name, throws = f"test-{os.getpid()}-films", Throws(four_cameras(), 1)
    sources = ",".join(str(path) for path in films)
    with (
        o80.robots.load(VideoCameras).inline(
            name, frequency=RATE, history=4, sources=sources, films=True
        ) as cameras,
        o80.robots.load(BallTracker).inline(f"{name}-ball", frequency=RATE, cameras=name) as ball,
    ):
        apart = []
        for i in range(1, 36):
            cameras.burst(1)
            ball.burst(1)
            row = ball.latest().extended
            if row["reason"] == Reason.seen:
                place = throws.at(0.3 + i / RATE).position
                apart.append(np.linalg.norm(row["position"] - place))
    assert len(apart) > 20
    assert np.mean(apart) < 0.01  # compressed films


def test_a_film_that_is_not_there_is_named() -> None:
    with (
        pytest.raises(o80.DriverError, match=r"nowhere\.avi cannot be opened"),
        o80.robots.load(VideoCameras).inline(frequency=30, sources="nowhere.avi", films=True),
    ):
        pass


def test_a_camera_that_is_not_there_is_a_marked_gap() -> None:
    with o80.robots.load(VideoCameras).inline(
        f"test-{os.getpid()}-no-camera", frequency=30, history=4, sources="/dev/video-none"
    ) as cameras:
        cameras.burst(3)
        row = cameras.latest().extended
        assert row["capture_time"] == 0
        assert not row["valid"].any()
