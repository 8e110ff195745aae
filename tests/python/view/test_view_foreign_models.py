"""A model from a recording cannot make `o80 view` read files, hang, or take all memory."""

import os
from pathlib import Path
from typing import Any

import pytest

import o80
from o80.view import foreign_model
from o80.view.answers import Answers
from o80.view.source_list import SourceList

PLAIN = """
<mujoco>
  <worldbody>
    <body name="arm"><joint name="elbow" axis="0 1 0"/><geom size="0.1 0.2" type="capsule"/></body>
  </worldbody>
</mujoco>
"""


def introduced(*names: str, model_files: bool = False) -> dict[str, Any]:
    """Introduction that a page gets first."""
    found: dict[str, Any] = Answers(SourceList(names, model_files=model_files), control=False).look(
        {}
    )["new"]
    return found


def recording_with(model: str, folder: Path, segment: str) -> Path:
    """A recording of a robot that is drawn by this model."""
    path = folder / "stranger.mcap"
    with (
        o80.Backend(segment, ["elbow"], model=model, joints={"elbow": "elbow"}) as backend,
        o80.Recording(path, segment) as recording,
    ):
        backend.publish()
        backend.step()
        backend.publish()
        while recording.rows < 2:
            recording.flush()
    o80.clean(segment)
    return path


def test_a_model_of_a_recording_is_drawn_as_that_of_the_robot(
    arm: o80.Frontend, tmp_path: Path
) -> None:
    path = tmp_path / "run.mcap"
    with o80.Recording(path, arm):
        arm.burst(5)
    scene = introduced(str(path))["scene"]
    assert scene is not None
    assert scene == introduced(arm.segment)["scene"]


@pytest.mark.parametrize(
    "line",
    [
        '<include file="{file}"/>',
        '<asset><model name="a" file="{file}"/></asset>',
        '<asset><mesh name="a" file="/dev/zero.stl"/></asset>',
        '<asset><texture name="a" type="cube" fileup="/dev/zero"/></asset>',
        '<asset><hfield name="a" file="{pipe}" size="1 1 1 1"/></asset>',
    ],
)
def test_no_file_that_a_recording_names_is_read(line: str, segment: str, tmp_path: Path) -> None:
    file, pipe = tmp_path / "secret.xml", tmp_path / "pipe.png"
    file.write_text('<mujoco><worldbody><geom name="secret" size="1"/></worldbody></mujoco>')
    os.mkfifo(pipe)  # who opens it waits forever
    model = PLAIN.replace("<worldbody>", line.format(file=file, pipe=pipe) + "<worldbody>")
    path = recording_with(model, tmp_path, segment)
    new = introduced(str(path))
    assert new["scene"] is None
    assert "names a file" in new["no_scene"]
    assert "--model-files" in new["no_scene"]
    with o80.play(path, speed=float("inf")) as playback:
        playback.wait()
        assert "names a file" in introduced(segment)["no_scene"]


def test_the_user_may_allow_the_files_of_models(segment: str, tmp_path: Path) -> None:
    file = tmp_path / "floor.xml"
    file.write_text('<mujoco><worldbody><geom type="plane" size="1 1 1"/></worldbody></mujoco>')
    model = PLAIN.replace("<worldbody>", f'<include file="{file}"/><worldbody>')
    path = recording_with(model, tmp_path, segment)
    shapes = {geom["shape"] for geom in introduced(str(path), model_files=True)["scene"]["geoms"]}
    assert shapes == {"plane", "capsule"}


@pytest.mark.parametrize(
    ("model", "why"),
    [
        ('<!DOCTYPE m [<!ENTITY a "b">]><mujoco/>', "document type"),
        ("<mujoco>" + "<a>" * 5000 + "</a>" * 5000 + "</mujoco>", "nested more than"),
        ("<mujoco><worldbody>", "no element found"),
        ("<mujoco><nonsense/></mujoco>", "nonsense"),
        (
            '<mujoco><asset><texture name="a" type="2d" builtin="flat" width="200000" '
            'height="200000"/></asset></mujoco>',
            "",
        ),
        ('<mujoco><size memory="900G"/></mujoco>', "memory"),
    ],
)
def test_hostile_models_are_told_and_the_rest_is_shown(
    model: str, why: str, segment: str, tmp_path: Path
) -> None:
    path = recording_with(model, tmp_path, segment)
    new = introduced(str(path))
    assert new["scene"] is None
    assert "cannot be read" in new["no_scene"]
    assert why in new["no_scene"]
    assert new["panels"] == ["elbow"]


def test_a_model_that_takes_forever_is_given_up(
    segment: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(foreign_model, "TIMEOUT", 2.0)
    line = '<replicate count="1000000" euler="0 0 1"><geom size="1"/></replicate>'
    model = PLAIN.replace("</worldbody>", f"{line}</worldbody>")
    path = recording_with(model, tmp_path, segment)
    assert "not compiled within 2 s" in introduced(str(path))["no_scene"]
