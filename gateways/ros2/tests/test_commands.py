"""Commands that come from ROS: what moves, and what is refused as a whole."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from carried import OFFSET, Carried, Carry
from stand_in_ros import of

import o80


def trajectory(
    joints: Sequence[str], points: Sequence[tuple[float, Sequence[float]]], stamp: int = 0
) -> Any:
    """Points by time [s]; stamp: [ns], 0 for now."""
    message = of("trajectory_msgs.msg.JointTrajectory")(joint_names=list(joints))
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, 10**9)
    for time, positions in points:
        point = of("trajectory_msgs.msg.JointTrajectoryPoint")(positions=list(positions))
        point.time_from_start.sec = int(time)
        point.time_from_start.nanosec = round((time - int(time)) * 1e9)
        message.points.append(point)
    return message


def numbers(*values: float) -> Any:
    return of("std_msgs.msg.Float64MultiArray")(data=list(values))


def refusals(carried: Carried) -> str:
    """The reasons of all refusals so far."""
    carried.tick()
    return "\n".join(carried.node.logged)


def test_a_trajectory_without_a_stamp_begins_now_and_reaches_each_point(carry: Carry) -> None:
    with o80.robots.load("two_joints").inline(frequency=500) as robot:
        carried = carry(robot)
        robot.burst(10)
        carried.send(
            "joint_trajectory", trajectory(["elbow"], [(0, [0]), (0.2, [0.1]), (0.4, [0.4])])
        )
        robot.burst(300)

        assert not refusals(carried)
        assert robot.history(since=110, until=110).desired[0].tolist() == [0.0, 0.1]
        assert robot.history(since=210, until=210).desired[0].tolist() == [0.0, 0.4]


def test_a_trajectory_with_a_stamp_is_anchored_there_though_it_comes_late(carry: Carry) -> None:
    with o80.robots.load("two_joints").inline(frequency=500) as robot:
        carried = carry(robot)
        robot.burst(10)
        seen = robot.latest().time
        robot.burst(50)  # the sender thinks for 0.1 s
        rows = [(0.1 * i, [0.01 * i, -0.01 * i]) for i in range(1, 8)]
        carried.send("joint_trajectory", trajectory(["elbow", "shoulder"], rows, seen))
        robot.burst(400)

        assert not refusals(carried)
        for i in range(4, 8):
            (there,) = robot.history(since=10 + 50 * i, until=10 + 50 * i).desired
            assert np.allclose(there, [-0.01 * i, 0.01 * i])
        carried.send("joint_trajectory", trajectory(["elbow", "shoulder"], rows, seen))
        assert "its last point was due 0.200 s ago" in refusals(carried)


@pytest.mark.parametrize(
    ("joints", "points", "why"),
    [
        (["elbow", "nose"], [(1, [0.1, 0.1])], "joint_names must be from"),
        (["elbow", "elbow"], [(1, [0.1, 0.1])], "each once"),
        (["elbow", "shoulder"], [(1, [0.1, math.nan])], "nan"),
        (["elbow", "shoulder"], [(1, [0.1, 0.1]), (2, [0.1])], "each point needs"),
        (["elbow", "shoulder"], [(1, [0.1, 99.0])], "3"),
        (["elbow"], [], "each point needs"),
        (["elbow"], [(2, [0.1]), (1, [0.2])], "must rise"),
        (["elbow"], [(0.0, [0.1])], "past"),
    ],
)
def test_a_wrong_trajectory_moves_nothing(
    carry: Carry, joints: list[str], points: list[Any], why: str
) -> None:
    with o80.robots.load("two_joints").inline(frequency=500) as robot:
        carried = carry(robot)
        robot.burst(2)
        carried.send("joint_trajectory", trajectory(joints, points))
        robot.burst(2000)

        assert why in refusals(carried)
        assert not robot.history().desired.any(), "not by half a message"


class Slow:
    """An arm with limits of speed."""

    actuators = ("left", "right")
    limits = dict.fromkeys(actuators, o80.Limits(minimum=-3, maximum=3, speed=2.0))
    simulated = True

    def write(self, desired: Any) -> None:
        self.positions = np.array(desired.states)

    def read(self, reading: Any) -> None:
        reading.observed = getattr(self, "positions", np.zeros(2))


def test_a_trajectory_beyond_limits_of_speed_moves_nothing(carry: Carry) -> None:
    with o80.robots.load(Slow).inline(frequency=100) as robot:
        carried = carry(robot)
        for rows in ([(0.5, [0.1, 0.1]), (0.6, [0.2, 0.5])], [(0.1, [0.1, 0.4])]):
            carried.send("joint_trajectory", trajectory(["left", "right"], rows))
        robot.burst(200)

        assert refusals(carried).count("'right' would need a speed of 4 to reach") == 2
        assert not robot.history().desired.any()


def test_a_stamp_across_a_step_of_the_wall_clock_is_refused(carry: Carry) -> None:
    with o80.robots.load("two_joints").start(frequency=500) as process:
        carried = carry(process.frontend())
        carried.monotonic = process.frontend().latest().time
        ahead = trajectory(["elbow"], [(1e6, [0.1])], carried.monotonic + OFFSET)
        carried.send("joint_trajectory", ahead)
        assert not refusals(carried)
        carried.clock._wall = lambda: carried.monotonic + OFFSET + 10**9
        carried.send("joint_trajectory", ahead)
        assert "wall clock was set" in refusals(carried)


def test_set_points_go_to_all_actuators(carry: Carry) -> None:
    with o80.robots.load("two_joints").inline(frequency=500) as robot:
        carried = carry(robot)
        for first in (0.3, 0.2, 0.1):  # of several in one iteration the newest counts
            carried.send("commands", numbers(first, 0.2))
        assert robot.burst(1).desired.tolist() == [0.1, 0.2]
        for wrong in (numbers(0.3), numbers(0.3, math.nan), numbers(0.3, 99.0)):
            carried.send("commands", wrong)
        assert (robot.burst(2).desired[0], carried.source.refused) == (0.1, 3)


def test_a_message_that_would_hold_up_a_halt_is_not_read(carry: Carry) -> None:
    with o80.robots.load("two_joints").inline() as robot:
        carried = carry(robot)
        carried.send("commands", numbers(*[0.0] * 70_000))
        points = [(0.001 * i, [0.1]) for i in range(1, 20_000)]
        carried.send("joint_trajectory", trajectory(["elbow"], points))
        assert refusals(carried).count("at most 524288 are read") == 2


def test_a_command_that_the_backend_rejects_is_reported(carry: Carry) -> None:
    with o80.robots.load("two_joints").inline() as robot:
        carried = carry(robot)
        robot.halt("the ball is on the floor")
        robot.burst(1)
        carried.send("commands", numbers(0.1, 0.2))
        robot.burst(1)
        assert "the ball is on the floor" in refusals(carried)
        level, message, values = carried.source.status()
        assert (level, values["halt text"]) == (b"\x01", "the ball is on the floor")
        assert "halted" in message


def test_services_halt_resume_request_and_step(carry: Carry) -> None:
    with o80.robots.load("two_joints").start(bursting=True) as process, process.frontend() as robot:
        carried = carry(robot, step=5)
        assert carried.call("step") == (True, "iteration 5")
        succeeded, text = carried.call("halt")
        assert succeeded
        assert "halt 1" in text
        carried.call("step")
        assert robot.halted is not None
        assert carried.call("resume") == (True, "the halt has ended")
        assert carried.call("resume") == (True, "there was no halt")
        assert carried.call("requests/home", speed=2.0) == (True, "home has ended")
        succeeded, text = carried.call("requests/home", sped=2.0)
        assert (succeeded, "sped" in text) == (False, True)


def test_a_gateway_that_only_reads_takes_nothing(carry: Carry) -> None:
    with o80.robots.load("two_joints").inline() as robot:
        node = carry(robot, command=False).node
        assert not {**node.subscribed, **node.served}
