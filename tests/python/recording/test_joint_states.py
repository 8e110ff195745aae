"""Joint states in a recording, as ROS tools read them."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from published_rows import messages_of
from rosbags.highlevel import AnyReader

import o80
from o80.recording.epoch import topic_of
from o80.recording.joint_states import joints_of
from o80.recording.scan import scan

JOINT = np.dtype([("position", "f8"), ("velocity", "f4"), ("torque", "f8")])


def joint_states(path: Path, segment: str) -> list[Any]:
    return [message for _, message in messages_of(path, topic_of(segment, "joint_states"))]


def recorded(segment: str, path: Path) -> o80.History:
    o80.Recording(path, segment).close()
    return o80.open(path)[segment].history()


def test_fields_of_a_state_are_position_velocity_and_effort(segment: str, path: Path) -> None:
    with o80.Backend(segment, {"joints": (JOINT, 3), "grip": "f8"}, bursting=True) as backend:
        observed = np.zeros(3, JOINT)
        for name in JOINT.names or ():
            observed[name] = np.arange(3) + ord(name[0])
        backend.publish({"joints": observed, "grip": 7.0})
        names = [actuator.name for actuator in o80.Frontend(segment).actuators]
        recorded(segment, path)
    (state,) = joint_states(path, segment)

    assert state.name == names[:3]
    assert state.position.tolist() == observed["position"].tolist()
    assert state.velocity.tolist() == observed["velocity"].tolist()
    assert state.effort.tolist() == observed["torque"].tolist()


def test_sensor_values_that_are_joint_positions_are_joints(segment: str, path: Path) -> None:
    sensors = np.dtype([("joint_positions", "f8", 4), ("joint_velocities", "f8", 4)])
    with o80.Backend(segment, ["a", "b"], extended=sensors, bursting=True) as backend:
        values = {"joint_positions": [1.0, 2, 3, 4], "joint_velocities": [5.0, 6, 7, 8]}
        backend.publish([0.0, 0.0], values)
        recorded(segment, path)
    (state,) = joint_states(path, segment)

    assert state.name == ["joint_0", "joint_1", "joint_2", "joint_3"]
    assert state.position.tolist() == values["joint_positions"]
    assert state.velocity.tolist() == values["joint_velocities"]
    assert len(state.effort) == 0


@pytest.mark.parametrize(
    "state", ["f8", "i8", np.dtype([("pressure", "f8")]), np.dtype([("position", "f8", 3)])]
)
def test_a_robot_without_joints_has_no_joint_states(state: Any, segment: str, path: Path) -> None:
    with o80.Backend(segment, ["a", "b"], state, bursting=True) as backend:
        backend.publish()
        assert joints_of(o80.Frontend(segment)._layout) is None
        recorded(segment, path)

    assert joint_states(path, segment) == []


def test_a_successor_goes_on_in_the_same_channel(arm: o80.Frontend, path: Path) -> None:
    for _ in range(2):
        arm.burst(10)
        o80.Recording(path, arm, proceed=path.exists()).close()

    assert len(joint_states(path, arm.segment)) == 21
    with AnyReader([path]) as reader:
        assert sum(each.topic.endswith("/joint_states") for each in reader.connections) == 1


def test_many_rows_are_read_without_decompressing_their_joint_states(
    arm: o80.Frontend, tmp_path: Path
) -> None:
    for count, apart in ((300, False), (3000, True)):
        arm.burst(count)
        assert len(recorded(arm.segment, tmp_path / f"{count}.mcap")) >= count
        found = scan(tmp_path / f"{count}.mcap")
        (own,) = (n for n, c in found.channels.items() if c.topic.endswith("/joint_states"))
        assert any({*each.message_index_offsets} == {own} for each in found.chunks) == apart
