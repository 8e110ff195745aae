"""Drawings of a MuJoCo robot by `o80 view`."""

import base64
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import o80
from o80.view.answers import Answers
from o80.view.source_list import SourceList

COURT = Path(__file__).parent / "models" / "court.xml"
CORNERS = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n"
WITH_MESH = """<mujoco><asset><mesh name="wedge" file="wedge.obj"/></asset><worldbody>
  <body><joint name="slide" type="slide" axis="0 0 1"/><geom type="mesh" mesh="wedge"/></body>
</worldbody></mujoco>"""


def look(robot: o80.Frontend) -> dict[str, Any]:
    return Answers(SourceList([robot.segment]), control=False).look({})


def poses(answer: dict[str, Any], kind: str = "pose") -> Any:
    """Position of each moving body by number."""
    numbers = np.frombuffer(base64.b64decode(answer[kind]), np.float32).reshape(-1, 7)
    return dict(zip(answer["new"]["scene"]["moving"], numbers[:, :3], strict=True))


def test_joints_and_balls_are_where_the_row_says() -> None:
    options: dict[str, Any] = {
        "model": str(COURT),
        "balls": "ball",
        "extra_balls": 2,
        "surfaces": "ground",
    }
    with o80.robots.load("mujoco").inline(**options) as robot:
        place = [0.25, -1.5, 2.0]
        robot.add_command("ball_2", {"position": place, "velocity": [0.0, 0.0, 0.0]})
        robot.add_command("joint_1", 0.5)
        robot.burst(1)
        answer = look(robot)
    moving = answer["new"]["scene"]["moving"]
    assert len(moving) >= 4
    assert poses(answer)[moving[-1]] == pytest.approx(place, abs=1e-6), "the last copy of the ball"
    assert answer["not_finite"] == []


def test_a_ball_that_flies_has_no_ghost() -> None:
    options: dict[str, Any] = {"model": str(COURT), "balls": "ball", "surfaces": "ground"}
    with o80.robots.load("mujoco").inline(**options) as robot:
        robot.add_command("ball", {"position": [0, 0, 3], "velocity": [0, 5, 0]})
        robot.burst(20)
        row = robot.latest()
        assert not row.active[-1]
        answer = look(robot)
    ball = answer["new"]["scene"]["moving"][-1]
    assert poses(answer, "ghost")[ball] == pytest.approx(poses(answer)[ball], abs=1e-6)


def test_meshes_are_found_beside_the_model(tmp_path: Path) -> None:
    (tmp_path / "wedge.obj").write_text(CORNERS)
    (tmp_path / "model.xml").write_text(WITH_MESH)
    with o80.robots.load("mujoco").inline(model=str(tmp_path / "model.xml")) as robot:
        scene = look(robot)["new"]["scene"]
        [mesh] = scene["meshes"].values()
        assert len(np.frombuffer(base64.b64decode(mesh["vertices"]), np.float32)) == 3 * 4
        assert len(np.frombuffer(base64.b64decode(mesh["faces"]), np.uint32)) == 3 * 4


def test_a_model_whose_meshes_are_gone_is_said_and_the_rest_is_shown(tmp_path: Path) -> None:
    (tmp_path / "wedge.obj").write_text(CORNERS)
    (tmp_path / "model.xml").write_text(WITH_MESH)
    with o80.robots.load("mujoco").inline(model=str(tmp_path / "model.xml")) as robot:
        (tmp_path / "wedge.obj").unlink()
        answer = look(robot)
        assert "wedge.obj" in answer["new"]["no_scene"]
        assert answer["new"]["panels"]


def test_a_recording_keeps_the_model(tmp_path: Path) -> None:
    model = tmp_path / "model.xml"
    model.write_text(
        WITH_MESH.replace('type="mesh" mesh="wedge"', 'size="0.1"').replace(
            '<asset><mesh name="wedge" file="wedge.obj"/></asset>', ""
        )
    )
    path = tmp_path / "run.mcap"
    with (
        o80.robots.load("mujoco").inline(model=str(model)) as robot,
        o80.Recording(path, robot),
    ):
        robot.add_command("slide", 0.75)
        robot.burst(1)
    model.unlink()
    answers = Answers(SourceList([str(path)]), control=False)
    first = answers.look({})
    answer = first | answers.look({"key": first["key"]})
    assert poses(answer)[1] == pytest.approx([0, 0, 0.75])
