"""Synthetic cameras that look at the ball of a world, in real time and while it is not there."""

from collections.abc import Iterator

import numpy as np
import pytest

import o80
from o80_devices.ball_tracking import SyntheticCameras
from o80_devices.cameras.ball_of_segment import BallOfSegment

PERIOD = 2_000_000  # [ns]
BALL = np.dtype([(name, float, (3,)) for name in ("position", "velocity", "spin")])
TIMES = {"world_row": np.int64, "arm_time": np.int64}
BEGIN = 5_000_000_000  # of the clock at row 0 of the world [ns]
FIELD = "observed.ball"


def place(time: float) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    """Place of the ball, at a time since row 0 [s]."""
    return np.array([0.4, 2.0 - 4.0 * time, 1.0 + time])


class World:
    """A world whose ball moves evenly, and the segment that says when its rows were."""

    def __init__(self, name: str) -> None:
        self.name, self.times = f"{name}-world", f"{name}-times"
        self._world = o80.Backend(self.name, {"ball": (BALL, ["ball"])}, frequency=500)
        self._told = o80.Backend(self.times, extended=TIMES)
        self._row = 0
        self._world.publish(self._ball(0))
        self._tell()

    def _ball(self, row: int) -> dict[str, np.ndarray[tuple[int, ...], np.dtype[np.void]]]:
        ball = np.zeros(1, BALL)
        ball["position"], ball["velocity"] = place(row * PERIOD * 1e-9), (0.0, -4.0, 1.0)
        return {"ball": ball}

    def _tell(self) -> None:
        self._told.publish(extended={"world_row": self._row, "arm_time": self.now})

    def go_on(self, rows: int) -> None:
        """Makes rows, and says when the last of them was."""
        for _ in range(rows):
            self._world.step()
            self._row += 1
            self._world.publish(self._ball(self._row))
        self._told.step()
        self._tell()

    @property
    def now(self) -> int:
        """Time of the newest row [ns]."""
        return BEGIN + self._row * PERIOD

    def close(self) -> None:
        self._world.close()
        self._told.close()


@pytest.fixture
def world(segment: str) -> Iterator[World]:
    made = World(segment)
    yield made
    made.close()


@pytest.fixture
def ball(world: World) -> Iterator[BallOfSegment]:
    made = BallOfSegment(world.name, FIELD, world.times)
    yield made
    made.close()


def test_the_ball_is_told_at_any_time_between_rows(world: World, ball: BallOfSegment) -> None:
    for _ in range(20):
        world.go_on(5)
        ball.at(world.now, world.now)  # as cameras do, which look all the time
    for since in np.linspace(0.15, 0.2, 37):
        found = ball.at(BEGIN + round(since * 1e9), world.now)
        assert found is not None
        np.testing.assert_allclose(found.position, place(since), atol=1e-8)
        np.testing.assert_allclose(found.velocity, (0.0, -4.0, 1.0))


def test_a_time_that_the_world_has_not_reached_has_no_ball(
    world: World, ball: BallOfSegment
) -> None:
    world.go_on(5)
    assert ball.at(world.now, world.now) is not None
    assert ball.at(world.now + 1, world.now) is None
    world.go_on(5)
    assert ball.at(world.now, world.now) is not None


def test_a_time_before_the_first_row_has_no_ball(world: World, ball: BallOfSegment) -> None:
    assert ball.at(BEGIN, BEGIN) is not None
    assert ball.at(BEGIN - 10_000_000, BEGIN) is None


def test_images_of_a_world_that_is_gone_are_marked_and_come_back(segment: str) -> None:
    cameras = o80.robots.load(SyntheticCameras)
    times, name = f"{segment}-times", f"{segment}-world"
    with cameras.inline(
        f"{segment}-cameras", frequency=180, ball=name, field=FIELD, times=times, history=4
    ) as images:
        assert images.latest().extended.capture_time == 0
        images.burst(2)
        assert images.latest().extended.capture_time == 0
        assert np.isnan(images.latest().extended.true_ball.position).all()
