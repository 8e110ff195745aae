"""The drivers of ball tracking as robots: bursting, and as processes in real time."""

import contextlib
import os
import signal
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import o80
from o80.drivers import Reading
from o80_devices.ball_tracking import BallTracker, Reason, Rig, SyntheticCameras, four_cameras
from o80_devices.cameras.flight import Flight, Table

RATE = 180


@contextlib.contextmanager
def inline(
    cameras: str, driver: type[SyntheticCameras] = SyntheticCameras
) -> Iterator[tuple[o80.Frontend, o80.Frontend]]:
    with (
        o80.robots.load(driver).inline(cameras, frequency=RATE, seed=1, history=4) as seen,
        o80.robots.load(BallTracker).inline(
            f"{cameras}-ball", frequency=RATE, cameras=cameras
        ) as ball,
    ):
        yield seen, ball


def test_a_burst_of_the_tracker_follows_the_newest_images() -> None:
    found = 0
    with inline(f"test-{os.getpid()}-cameras") as (cameras, tracker):
        for _ in range(150):
            cameras.burst(1)
            tracker.burst(1)
            row, truth = tracker.latest().extended, cameras.latest().extended
            assert row["image_time"] == truth["capture_time"]
            if row["reason"] != Reason.seen:
                assert row["capture_time"] == 0
                assert np.isnan(row["position"]).all()
                continue
            found += 1
            assert row["capture_time"] == truth["capture_time"]
            place = truth["true_ball"]["position"]
            assert np.linalg.norm(row["position"] - place) < 0.01
            assert row["error"] < 0.02
    assert found > 120


class StampedCameras(SyntheticCameras):
    """Their times are not exact."""

    def __init__(self, config: SyntheticCameras.Config) -> None:
        super().__init__(config)
        self.extended["errors"] = (np.int64, (4,))

    def read(self, reading: Reading) -> None:
        super().read(reading)
        reading.extended["errors"] = [100, 700, 300, 200]


def test_a_row_of_the_tracker_has_the_largest_error_of_the_times_of_its_images() -> None:
    found = set()
    with inline(f"test-{os.getpid()}-stamped", StampedCameras) as (cameras, tracker):
        for i in range(60):
            if i != 50:
                cameras.burst(1)
            tracker.burst(1)
            row = tracker.latest().extended
            found.add(Reason(int(row["reason"])))
            assert row["capture_error"] == (700 if row["reason"] == Reason.seen else 0)
    assert {Reason.seen, Reason.no_image} <= found


def test_without_new_images_the_row_says_so_and_holds_nothing() -> None:
    with inline(f"test-{os.getpid()}-still") as (cameras, tracker):
        for _ in range(60):
            cameras.burst(1)
            tracker.burst(1)
        assert tracker.latest().extended["reason"] == Reason.seen
        tracker.burst(1)
        row = tracker.latest().extended
        assert row["reason"] == Reason.no_image
        assert row["capture_time"] == 0
        assert np.isnan(row["position"]).all()
        cameras.burst(1)
        tracker.burst(1)
        assert tracker.latest().extended["reason"] == Reason.seen


@pytest.mark.check
def test_cameras_that_die_are_a_marked_gap_and_are_found_again() -> None:
    name = f"test-{os.getpid()}-dying"
    robot = o80.robots.load(SyntheticCameras)
    options: dict[str, Any] = {"frequency": 30, "seed": 1, "history": 4}
    with (
        robot.start(name, **options) as cameras,
        o80.robots.load(BallTracker).start(f"{name}-ball", frequency=30, cameras=name) as process,
        process.frontend() as ball,
    ):
        wait_for(ball, lambda row: row["reason"] == Reason.seen)
        os.kill(cameras.pid, signal.SIGKILL)
        wait_for(ball, lambda row: row["reason"] == Reason.no_image)
        with robot.start(name, **options):
            wait_for(ball, lambda row: row["image_time"] > 0)
            wait_for(ball, lambda row: row["reason"] == Reason.seen)


def wait_for(ball: o80.Frontend, is_so: Callable[[Any], bool]) -> None:
    for observation in ball.stream(timeout=30.0):
        if is_so(observation.extended):
            return


def test_a_segment_without_images_is_refused() -> None:
    name = f"test-{os.getpid()}-arm"
    with (
        o80.robots.load("two_joints").inline(name),
        pytest.raises(o80.DriverError, match="holds no images"),
        o80.robots.load(BallTracker).inline(frequency=RATE, cameras=name),
    ):
        pass


def test_the_rig_is_written_and_read(tmp_path: Path) -> None:
    path = tmp_path / "rig.json"
    rig = four_cameras()
    rig.save(path)
    assert Rig.load(path) == rig


@pytest.mark.parametrize(
    ("text", "wrong"),
    [
        ("{}", "format"),
        ("no json", "rig"),
        ('{"format": "o80-ball-rig-1", "cameras": []}', "2 to 16 cameras"),
        ('{"format": "o80-ball-rig-1", "cameras": [{"nam": 1}]}', "nam"),
    ],
)
def test_a_wrong_rig_is_refused_with_its_fault(tmp_path: Path, text: str, wrong: str) -> None:
    path = tmp_path / "rig.json"
    path.write_text(text)
    with pytest.raises(o80.InvalidArgument, match=wrong):
        Rig.load(path)


@pytest.mark.parametrize(
    ("part", "wrong"),
    [
        ({"flight": Flight(drag=np.nan)}, "drag must be a finite number"),
        ({"flight": Flight(gravity=(0.0, 9.81, 0.0))}, "gravity must point along z"),
        ({"table": Table(half=(-1.0, 1.0))}, "low must be less than high"),
        ({"table": Table(friction="much")}, "is not a number"),  # type: ignore[arg-type]
    ],
)
def test_a_rig_without_a_law_of_flight_is_refused(part: dict[str, Any], wrong: str) -> None:
    with pytest.raises(ValueError, match=wrong):
        replace(four_cameras(), **part).check()


@pytest.mark.parametrize("value", [0.0, 1e-200, -1.0, np.nan, np.inf])
@pytest.mark.parametrize("name", ["noise", "tolerance"])
def test_a_tracker_that_could_agree_on_no_place_is_refused(name: str, value: float) -> None:
    options: dict[str, Any] = {name: value}
    with pytest.raises(o80.InvalidArgument, match=f"{name} must be from 1e-06 to 1e\\+06 px"):
        BallTracker(BallTracker.Config(**options))
