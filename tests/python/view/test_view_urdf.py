"""A model as URDF: its joints, computed here, lead to where MuJoCo has the bodies."""

from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

import o80
from o80.recording.joint_states import joints_of
from o80.view.urdf import Links


@pytest.mark.parametrize("robot", ["two_joints", "pam"])
def test_a_chain_of_joints_ends_where_the_body_is(robot: str) -> None:
    pytest.importorskip("mujoco")
    with o80.robots.load(robot).inline() as arm:
        targets = [0.7, -0.4] if robot == "two_joints" else [18_000, 8_000] * 4
        arm.add_command(None, targets, iterations=100)
        row = bytes(memoryview(arm.burst(300)))  # type: ignore[arg-type]
        links, joints = Links.of(arm, "arm"), joints_of(arm._layout)
        assert links is not None
        assert joints is not None
        places = [number.offset for number in joints.numbers["position"]]
        names = dict(zip(places, joints.names, strict=True))
        urdf: Any = ElementTree.fromstring(links.urdf(arm.schema, names))
        angles = {name: np.frombuffer(row, "f8", 1, place)[0] for place, name in names.items()}
        behind = {each.find("child").get("link"): each for each in urdf.iter("joint")}
        found = [*links.places(row)]
        assert found
        for link, position, _ in found:
            at, here = np.eye(4), link
            while here != "world":
                joint = behind[here]
                at, here = moved(joint, angles) @ at, joint.find("parent").get("link")
            assert np.allclose(at[:3, 3], position, atol=1e-6), link


def moved(joint: Any, angles: dict[str, float]) -> Any:
    """The place of a joint's child in its parent (4, 4)."""
    origin = joint.find("origin")
    found = np.eye(4)
    roll, pitch, yaw = map(float, origin.get("rpy").split())
    found[:3, :3] = turned([0, 0, 1], yaw) @ turned([0, 1, 0], pitch) @ turned([1, 0, 0], roll)
    found[:3, 3] = [float(word) for word in origin.get("xyz").split()]
    if joint.get("type") in ("revolute", "continuous"):
        axis = [float(word) for word in joint.find("axis").get("xyz").split()]
        found[:3, :3] = found[:3, :3] @ turned(axis, angles[joint.get("name")])
    return found


def turned(axis: list[float], angle: float) -> Any:
    """The rotation about an axis (Rodrigues)."""
    x, y, z = np.array(axis) / np.linalg.norm(axis)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
