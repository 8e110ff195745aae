"""move_to waits until the robot is observed at its targets, and says where it is if it is not."""

import asyncio
import math
import pickle
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from processes import WAIT

import o80


class Plant:
    """Observed follows desired by half the way each time."""

    actuators = ("joints_0", "joints_1")
    dtype = {"position": float, "velocity": float, "held": bool}  # noqa: RUF012
    units = {"position": "rad", "velocity": "rad/s"}  # noqa: RUF012
    simulated = True
    share = 0.5

    def __init__(self) -> None:
        self.places = np.zeros(2)

    def write(self, desired: Any) -> None:
        self.places += self.share * (desired["position"] - self.places)

    def read(self, reading: Any) -> None:
        reading.observed = [(place, 7.0, False) for place in self.places]


class Stuck(Plant):
    """Observed stays."""

    share = 0.0


@pytest.fixture
def joints(segment: str) -> Iterator[o80.Frontend]:
    with o80.robots.load(Plant).inline(segment) as frontend:
        yield frontend


# rule S5
def test_says_where_the_robot_is(segment: str) -> None:
    named, targets = ["joints_0", "joints_1"], [0.5, {"position": 0.005}]
    with (
        o80.robots.load(Stuck).inline(segment) as joints,
        pytest.raises(o80.NotReached) as raised,
    ):
        joints.move_to(named, targets, tolerance=0.01, timeout=0.02)

    error = raised.value
    (miss,) = error.misses
    assert miss == ("joints_0", "position", 0.5, 0.0, 0.5, 0.01, "rad")
    assert error.observation.iteration == 20  # of the time of the robot
    assert isinstance(error, TimeoutError)
    assert error.batch is not None
    assert error.batch.statuses == [o80.Status.COMPLETED]
    assert "'joints_0' is observed at 0 rad, 0.5 rad from its target of 0.5 rad" in str(error)
    assert "Its command has completed" in str(error)
    again = pickle.loads(pickle.dumps(error))
    assert (str(again), again.misses, again.batch) == (str(error), error.misses, None)
    assert isinstance(again.misses[0], o80.Miss)
    assert again.observation.iteration == 20
    assert [handle.status for handle in again.handles] == [o80.Status.COMPLETED]


def test_a_tolerance_may_be_given_for_each_field_and_actuator(joints: o80.Frontend) -> None:
    both = {"position": 0.5, "velocity": 0.0}
    joints.move_to(0, both, tolerance={"position": 0.01}, timeout=WAIT)
    joints.move_to(0, both, tolerance={"position": 0.01, "velocity": 8.0}, timeout=WAIT)
    joints.move_to([0, 1], [both, both], tolerance={"position": 0.01}, timeout=WAIT)
    joints.move_to([0, 1], [both, 0.5], tolerance=[{"position": 0.01}, 0.1], timeout=WAIT)
    with pytest.raises(o80.NotReached, match="velocity of 'joints_1'"):
        joints.move_to(
            None, [both, both], tolerance=[{"position": 0.01}, {"velocity": 1.0}], timeout=0.02
        )


@pytest.mark.parametrize(
    ("tolerance", "said"),
    [
        (-0.1, "must be given, finite and not negative"),
        (math.inf, "must be given, finite and not negative"),
        (math.nan, "tolerance must be a number"),
        ("near", "tolerance must be a number, a mapping"),
        ([0.1, 0.1], "tolerance must be a number, a mapping"),
        ({"velocity": 0.1}, "'velocity' of actuator 'joints_0' is given, but no target"),
        ({"positon": 0.1}, "position"),
    ],
)
def test_refuses_a_tolerance_that_does_not_fit(
    joints: o80.Frontend, tolerance: object, said: str
) -> None:
    before = joints.published
    with pytest.raises(o80.InvalidArgument, match=said):
        joints.move_to(0, 1.0, tolerance=tolerance, timeout=WAIT)  # type: ignore[arg-type]
    assert joints.published == before
    assert joints.burst(1).active.tolist() == [False, False]


def test_takes_the_paces_of_a_command(arm: o80.Frontend) -> None:
    assert arm.move_to("elbow", 0.5, tolerance=3.0, iterations=20).iteration == 20
    assert arm.move_to("elbow", 0.0, tolerance=3.0, until=30).iteration == 30
    with pytest.raises(o80.InvalidArgument, match="one pace"):
        arm.move_to("elbow", 0.5, tolerance=3.0, iterations=20, speed=1.0)
    with pytest.raises(o80.InvalidArgument, match="outside its limits"):
        arm.move_to("elbow", 50.0, tolerance=3.0)


def test_is_awaited(process: o80.robots.Process, segment: str) -> None:
    async def move(arm: o80.Frontend) -> o80.Observation:
        with pytest.raises(o80.NotReached):
            await arm.aio.move_to("elbow", 1.0, tolerance=0.0, timeout=0.01, duration=1000.0)
        return await arm.aio.move_to(
            "elbow", 0.1, tolerance=1e-3, timeout=WAIT, iterations=10, mode="overwrite"
        )

    with process.frontend() as arm:
        assert abs(asyncio.run(move(arm)).observed[1] - 0.1) <= 1e-3
    with o80.robots.load("two_joints").inline() as inline:
        assert abs(asyncio.run(move(inline)).observed[1] - 0.1) <= 1e-3
