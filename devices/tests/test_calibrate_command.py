"""The command that calibrates a rig, from pictures and running cameras to a rig file."""

import json
import re
import shutil
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest
from numpy.typing import NDArray

import o80
from o80.base.arrays import FloatArray
from o80.drivers import Reading
from o80_devices.ball_tracking import Rig, four_cameras
from o80_devices.calibration import calibrate
from o80_devices.calibration import lenses as lens_files
from o80_devices.calibration.board import Board, lens_of
from o80_devices.calibration.bundle import triangulated
from o80_devices.calibration.lenses import Lens
from o80_devices.calibration.waved_ball import WavedBall
from o80_devices.cameras.scene import Scene

pytestmark = pytest.mark.check  # needs OpenCV, which only `make check` installs

LENS = four_cameras().cameras[0].moved(np.eye(3), np.zeros(3))
# four cameras with one lens, so that its pictures need to be drawn once
RIG = Rig(
    tuple(
        replace(LENS, name=c.name, rotation=c.rotation, translation=c.translation)
        for c in four_cameras().cameras
    )
)
NAMES = [camera.name for camera in RIG.cameras]
BOARD = Board((9, 6), 0.03)
INSIDE = ([-0.6, 0.2, 0.8], [1.4, 2.9, 1.7])
"""Bounds of the space that the ball is waved through [m]."""


def board_poses(count: int, tilt: float) -> list[tuple[FloatArray, FloatArray]]:
    """Rotation and translation of a board before the camera. tilt: at most, about each axis."""
    import cv2

    random, poses = np.random.default_rng(3), []
    for i in range(count):
        turn = np.asarray(cv2.Rodrigues(random.uniform(-tilt, tilt, 3))[0], np.float64)
        middle = np.array([0.1 * (i % 3 - 1), 0.07 * (i // 3 % 3 - 1), 0.42])
        poses.append((turn, middle - turn @ np.array([0.12, 0.075, 0])))
    return poses


def board_corners(count: int, tilt: float = 0.5, noise: float = 0.05) -> list[FloatArray]:
    """Where the camera sees the inner corners of boards [px]."""
    random, points = np.random.default_rng(4), BOARD.points().astype(float)
    seen = [
        LENS.model().project(np.ascontiguousarray(points @ turn.T + shift))[:, :2]
        for turn, shift in board_poses(count, tilt)
    ]
    return [each + noise * random.standard_normal(each.shape) for each in seen]


def board_picture(turn: FloatArray, shift: FloatArray) -> NDArray[np.uint8]:
    x, y = np.meshgrid(np.arange(640.0), np.arange(480.0))
    seen = np.zeros((480, 640))
    for dx, dy in ((-0.25, -0.25), (0.25, -0.25), (-0.25, 0.25), (0.25, 0.25)):  # smooth borders
        rays = LENS.model().directions(np.stack([x.ravel() + dx, y.ravel() + dy], axis=1))
        depth = (turn[:, 2] @ shift) / (rays @ turn[:, 2])
        on_board = (depth[:, np.newaxis] * rays - shift) @ turn[:, :2] / 0.03 + 1.0
        inside = ((on_board >= 0) & (on_board < (10, 7))).all(1)
        dark = inside & (np.floor(np.nan_to_num(on_board)).sum(1) % 2 == 0)
        seen += np.where(dark, 10.0, 60.0).reshape(480, 640)
    return np.repeat(seen.astype(np.uint8)[..., np.newaxis], 3, axis=-1)


def seen_by_all(points: FloatArray, noise: float = 0.0, seed: int = 0) -> FloatArray:
    """(n, cameras, 2) [px]; NaN outside of an image."""
    pixels = np.stack([camera.project(points)[:, :2] for camera in RIG.models()], axis=1)
    pixels[~((pixels >= 0) & (pixels < (640, 480))).all(-1)] = np.nan
    return pixels + noise * np.random.default_rng(seed).standard_normal(pixels.shape)


def run(*arguments: object) -> None:
    calibrate.main([str(each) for each in arguments])


class Files:
    """Files that the step `places` reads."""

    def __init__(self, folder: Path) -> None:
        self.lenses = folder / "lenses.json"
        self.wave = folder / "wave.npz"
        self.corners = folder / "corners.json"
        self.rig = folder / "rig.json"
        lens_files.save([Lens(replace(LENS, name=n), 0.1, 0.1, 12) for n in NAMES], self.lenses)
        self.write_wave(np.random.default_rng(1).uniform(*INSIDE, (160, 3)))
        assert RIG.table is not None
        self.marks = np.moveaxis(seen_by_all(RIG.table.corners, 0.3, seed=4), 1, 0)
        self.write_corners(self.marks)

    def write_wave(self, points: FloatArray) -> None:
        WavedBall(tuple(NAMES), seen_by_all(points, 0.3, seed=2)).save(self.wave)

    def write_corners(self, marks: FloatArray) -> None:
        self.corners.write_text(
            json.dumps({"corners": dict(zip(NAMES, marks.tolist(), strict=True))})
        )

    def place(self) -> None:
        run(
            *("places", "--lenses", self.lenses, "--wave", self.wave),
            *("--corners", self.corners, "-o", self.rig),
        )


@pytest.fixture
def files(tmp_path: Path) -> Files:
    return Files(tmp_path)


# ---------------------------------------------------------------------- places


def number_after(words: str, output: str) -> float:
    return float(re.findall(rf"{words}\D*([\d.]+)", output)[0])


def test_the_rig_is_written_and_its_errors_are_told(
    files: Files, capsys: pytest.CaptureFixture[str]
) -> None:
    files.place()
    output = capsys.readouterr().out
    for moments in ("fitted:", "held out:"):  # 0.3 px of noise in x and in y
        assert 0.2 < number_after(moments, output) < 0.4
    assert number_after("without one of its cameras:", output) < 5.0
    assert number_after("placed by the other three:", output) < 10.0
    assert "0 of 40 held-out moments do not fit" in output
    points = np.random.default_rng(7).uniform(*INSIDE, (100, 3))
    rig = Rig.load(files.rig)
    away = np.linalg.norm(triangulated(rig.cameras, seen_by_all(points)) - points, axis=1)
    assert np.nanmean(away) < 0.005


def marked_otherwise(order: list[int], images: list[int]) -> Callable[[Files], None]:
    def change(files: Files) -> None:
        files.marks[images] = files.marks[images][:, order]
        files.write_corners(files.marks)

    return change


ELSEWHERE = np.random.default_rng(1).uniform([0.3, 1.5, 1.0], [0.5, 1.7, 1.1], (160, 3))
TOO_FEW = np.random.default_rng(1).uniform(*INSIDE, (12, 3))
IN_A_PLANE = np.random.default_rng(1).uniform(*INSIDE, (160, 3)) * [1, 1, 0] + [0, 0, 1]


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (marked_otherwise([1, 0, 3, 2], [0, 1, 2, 3]), "below the table: the corners are mirrored"),
        (marked_otherwise([1, 2, 3, 0], [0, 1, 2, 3]), r"only within \d+ mm: check the order"),
        (marked_otherwise([1, 2, 3, 0], [2]), "marked at different places of the room"),
        (lambda files: files.write_wave(ELSEWHERE), "wave it through the whole space"),
        (lambda files: files.write_wave(TOO_FEW), "see the ball together in"),
        (lambda files: files.write_wave(IN_A_PLANE), "waved in a plane"),
        (lambda files: files.wave.write_bytes(b""), "is not a recording of a waved ball"),
        (lambda files: files.wave.write_bytes(b"nothing"), "is not a recording of a waved ball"),
        (lambda files: shutil.copy(files.lenses, files.wave), "is not a recording of a waved ball"),
        (lambda files: RIG.save(files.lenses), "make it with `calibrate lenses`"),
    ],
)
def test_wrong_files_are_told(files: Files, change: Callable[[Files], object], text: str) -> None:
    change(files)
    with pytest.raises(SystemExit, match=text):
        files.place()
    assert not files.rig.exists()


@pytest.mark.parametrize(
    ("content", "error"),
    [
        ('{"corners": {"camera_9": [[1, 2], [3, 4], [5, 6], null]}}', "marked for camera_9"),
        ('{"corners": {"camera_0": [[1, 2], [3, 4]]}}', "must have four corners"),
        ('{"corners": {"camera_0": [[1, 2], [3, 4], [5, 6], null]}}', "3 are needed"),
        ('{"corners": {"camera_0": [[1, 2], [3, 4], [5, 6], [7]]}}', "corners"),
        ("[]", "does not hold the corners"),
        ("", "does not hold the corners"),
        ('{"table": {"half": [0.7, -1]}, "corners": {}}', "must be lengths"),
    ],
)
def test_damaged_marks_of_corners_are_told(files: Files, content: str, error: str) -> None:
    files.corners.write_text(content)
    with pytest.raises(SystemExit, match=error):
        files.place()


# ---------------------------------------------------------------------- lenses


@pytest.mark.parametrize("tilt", [0.0, 0.02, 0.05])
def test_a_board_that_was_hardly_tilted_is_refused(tilt: float) -> None:
    with pytest.raises(o80.InvalidArgument, match="Tilt it by 20 to 40 degrees"):
        lens_of("left", (640, 480), board_corners(12, tilt), BOARD)


def test_a_tilted_board_gives_the_lens() -> None:
    lens, _ = lens_of("left", (640, 480), board_corners(12, tilt=0.4), BOARD)
    assert np.allclose(lens.focal, LENS.focal, rtol=0.01)


def test_too_few_boards_are_told(tmp_path: Path) -> None:
    import cv2

    (tmp_path / "left").mkdir()
    picture = board_picture(*board_poses(1, 0.3)[0])
    for i in range(3):
        cv2.imwrite(str(tmp_path / "left" / f"{i}.png"), picture)
    cv2.imwrite(str(tmp_path / "left" / "empty.png"), np.zeros_like(picture))
    with pytest.raises(SystemExit, match="in 3 of 4 pictures of left: 11 are needed"):
        run("lenses", tmp_path, "--square", 0.03)


def test_a_folder_without_folders_is_told(tmp_path: Path) -> None:
    with pytest.raises(SystemExit, match="put those of each camera into a folder"):
        run("lenses", tmp_path, "--square", 0.03)


def test_a_broken_picture_and_one_of_another_size_are_named(tmp_path: Path) -> None:
    import cv2

    (tmp_path / "left").mkdir()
    cv2.imwrite(str(tmp_path / "left" / "1.png"), np.zeros((480, 640, 3), np.uint8))
    (tmp_path / "left" / "2.png").write_bytes(b"no picture")
    with pytest.raises(SystemExit, match=r"2\.png cannot be read"):
        run("lenses", tmp_path, "--square", 0.03)
    cv2.imwrite(str(tmp_path / "left" / "2.png"), np.zeros((240, 320, 3), np.uint8))
    with pytest.raises(SystemExit, match="has 320 x 240 pixels, the pictures before it"):
        run("lenses", tmp_path, "--square", 0.03)


# ---------------------------------------------------------------------- running cameras


class ScriptedCameras:
    """The cameras of RIG: a ball at a new place in each image, or a board before each camera."""

    shows: ClassVar[str] = "ball"
    pictures: ClassVar[list[NDArray[np.uint8]]] = []

    @dataclass
    class Config:
        pass

    def __init__(self, config: Config) -> None:
        self.extended: dict[str, Any] = {
            "capture_time": np.int64,
            "images": (np.uint8, (4, 480 * 640 * 3)),
        }

    def start(self) -> None:
        self._scene = Scene(RIG, variations=1)
        self._random = np.random.default_rng(5)
        self._count = 0

    def read(self, reading: Reading) -> None:
        reading.extended["capture_time"] = max(1, reading.time)
        place = self._random.uniform(*INSIDE)
        self._count += 1
        for k, image in enumerate(reading.extended["images"]):
            if self.shows == "ball":
                self._scene.image(k, place, np.zeros(3), image.reshape(480, 640, 3))
            else:
                image[...] = self.pictures[self._count % len(self.pictures)].ravel()

    def stop(self) -> None:
        pass


class Running:
    """Bursts cameras as long as a step reads them: no step depends on the speed of the machine."""

    def __init__(self, cameras: Any) -> None:
        self._cameras = cameras
        self._ends = threading.Event()
        self._thread = threading.Thread(target=self._run)

    def __enter__(self) -> None:
        self._thread.start()

    def __exit__(self, *_: object) -> None:
        self._ends.set()
        self._thread.join()

    def _run(self) -> None:
        while not self._ends.is_set():
            self._cameras.burst(1)


@pytest.fixture
def cameras(segment: str) -> Iterator[str]:
    ScriptedCameras.shows = "ball"
    with (
        o80.robots.load(ScriptedCameras).inline(segment, frequency=30, history=4) as cameras,
        Running(cameras),
    ):
        yield segment


def test_a_picture_of_each_camera_is_saved(files: Files, cameras: str, tmp_path: Path) -> None:
    run(
        *("pictures", "--segment", cameras, "--lenses", files.lenses),
        *("-o", tmp_path / "pictures"),
    )
    assert sorted(f.name for f in (tmp_path / "pictures").iterdir()) == [f"{n}.png" for n in NAMES]


def test_cameras_that_see_no_ball_are_told(
    files: Files, cameras: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    from o80_devices.calibration import waved_ball

    monkeypatch.setattr(ScriptedCameras, "pictures", [np.zeros((480, 640, 3), np.uint8)])
    monkeypatch.setattr(ScriptedCameras, "shows", "nothing")
    patient = waved_ball.collected
    monkeypatch.setattr(calibrate, "collected", lambda *a, **k: patient(*a, patience=0.2, **k))
    with pytest.raises(SystemExit, match="no two cameras have seen the ball"):
        run("wave", "--segment", cameras, "--lenses", files.lenses, "-o", files.wave)


def test_a_rig_is_calibrated_from_pictures_and_running_cameras(
    tmp_path: Path,
    segment: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """All steps one after the other, on the images of cameras whose places are known."""
    import cv2

    monkeypatch.chdir(tmp_path)
    pictures = [board_picture(*pose) for pose in board_poses(16, 0.5)]
    (tmp_path / "boards" / "left").mkdir(parents=True)
    for i, picture in enumerate(pictures):
        cv2.imwrite(str(tmp_path / "boards" / "left" / f"{i:02}.png"), picture)
    run("lenses", "boards", "--square", BOARD.square)
    assert number_after(r"left .* \d\.\d+ ", capsys.readouterr().out) < 0.3
    (lens,) = lens_files.load("lenses.json")
    assert np.allclose(lens.focal, LENS.focal, rtol=0.01)
    assert np.allclose(lens.centre, LENS.centre, atol=5.0)
    corner = np.array([[20.0, 20.0], [620.0, 20.0], [600.0, 460.0]])
    apart = lens.model().directions(corner) - LENS.model().directions(corner)
    assert np.abs(apart).max() < 0.01

    monkeypatch.setattr(ScriptedCameras, "shows", "board")
    monkeypatch.setattr(ScriptedCameras, "pictures", pictures)
    with o80.robots.load(ScriptedCameras).inline(segment, frequency=30, history=4) as cameras:
        with Running(cameras):  # and all four live
            run(
                *("lenses", "--segment", segment, "--names", ",".join(NAMES)),
                *("--pictures", 11, "--square", BOARD.square),
            )
        ScriptedCameras.shows = "ball"
        with Running(cameras):
            run("wave", "--segment", segment, "--moments", 200)
    (tmp_path / "marks").mkdir()
    run("places", "--corners", Files(tmp_path / "marks").corners)

    points = np.random.default_rng(7).uniform(*INSIDE, (100, 3))
    away = np.linalg.norm(
        triangulated(Rig.load("rig.json").cameras, seen_by_all(points)) - points, axis=1
    )
    assert np.nanmean(away) < 0.005
