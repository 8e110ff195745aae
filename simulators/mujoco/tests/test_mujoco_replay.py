"""Runs of a MuJoCo model repeat bit for bit, also with balls."""

import random
from pathlib import Path
from typing import Any

import pytest

import o80

MODELS = Path(__file__).parent / "models"
WAIT = 60.0  # [s] longer than any wait should take


def act(arm: o80.Frontend, choose: random.Random) -> None:
    for _ in range(choose.randrange(3)):
        actuator = choose.choice([each.name for each in arm.actuators if each.name != "ball"])
        arm.add_command(actuator, choose.uniform(-1, 1), iterations=choose.randrange(1, 20))
    arm.pulse()
    if choose.random() < 0.1:
        request = choose.choice(
            [("reset", {"seed": 3}), ("snapshot", {"slot": 0}), ("restore", {})]
        )
        arm.add_request(request[0], **request[1])
        arm.pulse()


@pytest.mark.parametrize("seed", range(3))
def test_bursts_repeat(seed: int) -> None:
    choose = random.Random(seed)
    model = MODELS / "pendulum.xml"
    with o80.robots.load("mujoco").inline(model=model, mode="control") as arm:
        for _ in range(80):
            act(arm, choose)
            arm.burst(choose.randrange(1, 12))
        report = o80.replay(arm)
        assert report.identical, report


def test_a_run_in_real_time_repeats() -> None:
    choose = random.Random(5)
    name = "test-mujoco-replay"
    model = MODELS / "pendulum.xml"
    with o80.robots.load("mujoco").start(name, model=model, mode="control") as process:
        arm = process.frontend()
        for _ in range(50):
            act(arm, choose)
            arm.wait_for(arm.published + choose.randrange(1, 8), timeout=WAIT)
        report = o80.replay(arm)
        assert report.identical, report
        arm.close()
    o80.clean(name)


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


@pytest.mark.parametrize(
    ("model", "options"),
    [
        ("pendulum.xml", {"mode": "control"}),
        (HEAP, {"mode": "control"}),
        (
            "court.xml",
            {"balls": "ball", "surfaces": "ground=0.7, bench, paddle", "watched": "paddle"},
        ),
    ],
)
def test_a_replay_begins_with_a_reset_or_a_snapshot(
    model: str, options: dict[str, Any], tmp_path: Path
) -> None:
    choose = random.Random(6)
    path = MODELS / model if model.endswith(".xml") else tmp_path / "heap.xml"
    if model is HEAP:
        path.write_text(HEAP)
    with o80.robots.load("mujoco").inline(model=path, history=400, **options) as arm:
        arm.burst(100)
        arm.request("snapshot", slot=0)
        act(arm, choose)
        arm.request("snapshot", slot=2)
        for _ in range(30):
            act(arm, choose)
            arm.burst(choose.randrange(1, 12))
        for request, fields in (("restore", {"slot": 2}), ("reset", {})):
            arm.request(request, **fields)
            row = arm.published
            for _ in range(15):
                act(arm, choose)
                arm.burst(choose.randrange(1, 12))
            (run,) = o80.replay(arm, since=row)
            assert run.identical, run
            assert run.notes[0] == f"the replay begins with the {request} of row {row}"
