"""Rows of robots as messages: values, names, stamps, and what was missed."""

import zlib
from dataclasses import dataclass
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from carried import OFFSET, Carry

import o80
from o80_ros2.sensors import sensors_of


def nanoseconds(message: Any) -> int:
    stamp = message.header.stamp
    return int(stamp.sec * 10**9 + stamp.nanosec)


def test_every_row_is_a_message_of_joints_stamped_with_its_time(carry: Carry) -> None:
    with o80.robots.load("two_joints").inline(frequency=500) as robot:
        carried = carry(robot)
        robot.add_command("elbow", 0.5, iterations=20)
        robot.burst(30)
        carried.tick()

        history = robot.history()
        states, desired = carried.sent("joint_states"), carried.sent("desired")
        assert len(states) == len(desired) == 31
        assert states[0].name == ["shoulder", "elbow"]
        assert np.array_equal([each.position for each in states], history.observed)
        assert np.array_equal([each.effort for each in states], history.extended.effort)
        assert np.array_equal([each.position for each in desired], history.desired)
        assert [nanoseconds(each) for each in states] == history.time.tolist()
        assert not any(len(each.effort) for each in desired), "a measured effort is not desired"


def test_a_robot_on_the_monotonic_clock_has_stamps_on_the_wall_clock(carry: Carry) -> None:
    with o80.robots.load("two_joints").start(frequency=500) as process:
        carried = carry(process.frontend(), rates={"": 50.0})
        with process.frontend() as robot:
            (state,) = carried.sent("joint_states")
            assert nanoseconds(state) - OFFSET in robot.history().time.tolist()


def test_rows_that_were_overwritten_are_counted(carry: Carry) -> None:
    with o80.robots.load("two_joints").inline() as robot:
        carried = carry(robot)
        while robot.oldest < 100:
            robot.burst(1000)
        rows = robot.history(since=robot.oldest)
        carried.tick()

        assert carried.source.missed == rows.iteration[0] - 1
        assert nanoseconds(carried.sent("joint_states")[1]) == rows.time[0]


def test_a_quaternion_whose_help_begins_with_w_is_sent_as_ros_has_it() -> None:
    field = {"kind": "float64", "unit": "m", "help": "w, x, y, z"}
    fields = [field | {"name": n, "shape": [s]} for n, s in (("position", 3), ("quaternion", 4))]
    (sensor,) = sensors_of({"extended": {"fields": fields}}, {})
    kind = [("extended", [("position", "f8", 3), ("quaternion", "f8", 4)])]
    values = sensor.values(np.array((((0, 0, 0), (1, 0, 0, 0)),), kind))
    assert values is not None
    assert values[1].tolist() == [0, 0, 0, 1]


def test_a_rate_gives_the_newest_row_once(carry: Carry) -> None:
    with o80.robots.load("two_joints").inline() as robot:
        carried = carry(robot, rates={robot.segment: 10.0})
        robot.burst(7)
        carried.tick()
        carried.tick()
        times = [nanoseconds(each) for each in carried.sent("joint_states")]
        assert times == [0, robot.latest().time]


def test_a_gateway_that_is_behind_counts_the_periods_that_it_left_out(carry: Carry) -> None:
    with o80.robots.load("two_joints").inline() as robot:
        carried = carry(robot, rates={"": 10.0})
        carried.tick()
        assert carried.source.late == 0
        carried.now += 2.0
        carried.tick()
        assert 20 <= carried.source.late <= 30


def test_names_are_legal_and_a_prefix_keeps_arms_apart(carry: Carry) -> None:
    with o80.robots.load("two_joints").inline("2-arms.of_me") as robot:
        carried = carry(robot, prefix="left_")
        assert carried.source.name == "left_2_arms_of_me"
        assert carried.sent("joint_states")[0].name == ["left_shoulder", "left_elbow"]


def test_pressures_are_desired_positions_and_the_racket_is_a_point(carry: Carry) -> None:
    with o80.robots.load("pam").inline() as robot:
        carried = carry(robot)
        robot.burst(50)
        carried.tick()
        row = robot.latest()

        assert carried.sent("desired")[-1].position.tolist() == row.desired.tolist()
        assert carried.sent("desired")[-1].name[0] == "agonist_1"
        assert carried.sent("joint_states")[-1].name == [f"joint_{i}" for i in range(4)]
        point = carried.sent("racket/point")[-1].point
        assert [point.x, point.y, point.z] == row.extended.racket_position.tolist()


class Sensors:
    """A force sensor, a subject of motion capture that comes and goes, and a camera."""

    actuators = ()
    units = {"capture_time": "ns", "position": "m"}  # noqa: RUF012
    extended = {  # noqa: RUF012
        "capture_time": np.int64,
        "force": (float, 3),
        "torque": (float, 3),
        "puck": {"visible": bool, "position": (float, 3), "quaternion": (float, 4)},
        "images": (np.uint8, (2, 18)),
        "valid": (bool, (2,)),
    }

    @dataclass
    class Config:
        width: int = 3
        height: int = 2

    def __init__(self, config: Config) -> None:
        self.count = -1

    def write(self, desired: Any) -> None:
        pass

    def read(self, reading: Any) -> None:
        self.count += 1
        reading.extended = {
            "capture_time": 0 if self.count == 2 else 7_000 + self.count,
            "force": [1.0, 2.0, 3.0],
            "torque": [4.0, 5.0, 6.0],
            "puck": (self.count != 1, [0.1, 0.2, 0.3], [0.0, 0.0, 0.0, 1.0]),
            "images": np.arange(36).reshape(2, 18),
            "valid": [False, True],
        }


def test_sensors_have_types_of_their_own_and_the_stamp_of_their_capture(carry: Carry) -> None:
    with o80.robots.load(Sensors).inline(frequency=100) as robot:
        carried = carry(robot)
        robot.burst(3)
        carried.tick()

        wrenches, poses = carried.sent("wrench"), carried.sent("puck/pose")
        assert [each.header.stamp.nanosec for each in wrenches] == [7000, 7001, 7003]
        assert [each.header.stamp.nanosec for each in poses] == [7000, 7003], "not the hidden one"
        frames = [each.child_frame_id for each in carried.sent("/tf")[-1].transforms]
        assert frames == [f"{carried.source.name}/puck"]
        assert (wrenches[0].wrench.force.z, wrenches[0].wrench.torque.x) == (3.0, 4.0)
        assert carried.node.qos[f"/{carried.source.name}/images_1/compressed"] == "best effort"
        assert not carried.sent("images_0/compressed"), "its camera gave none"
        image = carried.sent("images_1/compressed")[-1]
        assert image.format == "png"
        begin = image.data.tobytes().index(b"IDAT") + 4
        lines = zlib.decompress(image.data.tobytes()[begin:])
        assert lines == bytes([0, *range(18, 27), 0, *range(27, 36)]), "a filter, then pixels"


def test_the_model_is_shown_as_urdf_and_by_the_transforms_of_its_links(carry: Carry) -> None:
    pytest.importorskip("mujoco")
    with o80.robots.load("two_joints").inline() as robot:
        carried = carry(robot, prefix="left_")
        urdf = ElementTree.fromstring(carried.sent("robot_description")[0].data)
        links = {each.get("name") for each in urdf.iter("link")}
        assert {each.child_frame_id for each in carried.sent("/tf")[-1].transforms} <= links
        joints = {each.get("name") for each in urdf.iter("joint")}
        assert {"left_shoulder", "left_elbow"} <= joints, "as joint_states names them"


def test_a_backend_that_starts_again_is_carried_on(carry: Carry) -> None:
    with o80.robots.load("two_joints").inline("again") as robot:
        carried = carry(robot)
        robot.burst(3)
    carried.tick()
    assert len(carried.sent("joint_states")) == 4, "also the last rows"
    assert carried.source.status()[0] == b"\x02"
    with o80.robots.load("two_joints").inline("again") as robot:
        robot.burst(1)
        carried.tick()
        robot.burst(2)
        carried.tick()
        assert len(carried.sent("joint_states")) == 7
        assert carried.source.status()[0] == b"\x00"
