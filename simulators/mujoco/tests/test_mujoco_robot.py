"""MuJoCo models keep what o80 builds on, also with balls; a changed model is found."""

import random
from pathlib import Path
from typing import Any

import pytest

import o80
from o80.testing import check_robot

MODELS = Path(__file__).parent / "models"


def test_a_changed_model_is_noted_and_found(tmp_path: Path) -> None:
    model = tmp_path / "pendulum.xml"
    text = (MODELS / "pendulum.xml").read_text()
    model.write_text(text)
    with o80.robots.load("mujoco").inline(model=model, mode="control") as arm:
        arm.burst(5)
        arm.add_command(0, 0.5)
        arm.burst(20)
        changed = text.replace("<worldbody>", '<option gravity="0 0 -9.8"/>\n<worldbody>', 1)
        assert changed != text
        model.write_text(changed)
        (run,) = o80.replay(arm)
        assert run.difference is not None
        assert any("the file of the option model has changed" in note for note in run.notes)


# bodies that the engine integrates, in contact
HEAP = """
<mujoco>
  <worldbody>
    <geom type="plane" size="3 3 0.1"/>
    <body pos="0 0 0.5"><freejoint/><geom type="box" size="0.1 0.1 0.1"/></body>
    <body pos="0.05 0 0.9"><freejoint/><geom type="sphere" size="0.1"/></body>
    <body pos="0 0 1"><joint name="arm" axis="0 1 0"/>
      <geom type="capsule" fromto="0 0 0 0.3 0 -0.7" size="0.05"/></body>
  </worldbody>
  <actuator><motor name="arm" joint="arm" gear="3" ctrlrange="-1 1"/></actuator>
</mujoco>
"""


@pytest.mark.parametrize("name", ["pendulum.xml", "heap.xml"])
def test_models_keep_what_o80_builds_on(name: str, tmp_path: Path) -> None:
    (tmp_path / "heap.xml").write_text(HEAP)
    model = tmp_path / name if name == "heap.xml" else MODELS / name
    assert check_robot("mujoco", {"model": model, "mode": "control"}) == []


def test_a_replay_begins_with_a_reset_or_a_snapshot_of_balls() -> None:
    """Numbers without limits: `check_robot` would not move them."""
    choose = random.Random(6)

    def play(arm: o80.Frontend) -> None:
        for _ in range(15):
            joint = choose.choice([each.name for each in arm.actuators if each.name != "ball"])
            arm.add_command(joint, choose.uniform(-1, 1), iterations=choose.randrange(1, 20))
            arm.burst(choose.randrange(1, 12))

    court: dict[str, Any] = {"model": MODELS / "court.xml", "balls": "ball", "watched": "paddle"}
    with o80.robots.load("mujoco").inline(
        **court, surfaces="ground=0.7, bench, paddle", history=400
    ) as arm:
        play(arm)
        arm.request("snapshot", slot=2)
        play(arm)
        for request, fields in (("restore", {"slot": 2}), ("reset", {})):
            arm.request(request, **fields)
            row = arm.published
            play(arm)
            (run,) = o80.replay(arm, since=row)
            assert run.identical, run
            assert run.notes[0] == f"the replay begins with the {request} of row {row}"
