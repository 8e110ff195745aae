"""Runs of the simulated arm repeat bit for bit, and a changed plant is found where it acts."""

import random
from typing import Any

import pytest

import o80

WAIT = 60.0  # [s] longer than any wait should take


def act(arm: o80.Frontend, choose: random.Random) -> None:
    """Acts as a learner: targets that overwrite each other, late ones, resets, snapshots."""
    start = arm.initial_states
    for _ in range(choose.randrange(4)):
        muscle = choose.randrange(8)
        target = float(start[muscle]) + choose.uniform(0, 3000)
        how: dict[str, Any] = {
            "mode": choose.choice(["queue", "overwrite"]),
            "iterations": choose.randrange(1, 30),
        }
        arm.add_command(muscle, target, **how)
    arm.pulse(at=arm.published + choose.randrange(5) if choose.random() < 0.2 else None)
    if choose.random() < 0.1:
        arm.add_request(choose.choice(["snapshot", "restore"]), slot=1)
        arm.pulse()


@pytest.fixture(params=["linear", "hill"])
def muscle(request: pytest.FixtureRequest) -> str:
    """Both models of the muscles."""
    param: str = request.param
    return param


def test_bursts_repeat(muscle: str) -> None:
    choose = random.Random(1)
    with o80.robots.load("pam").inline(muscle=muscle) as arm:
        for _ in range(100):
            act(arm, choose)
            arm.burst(choose.randrange(1, 12))
        report = o80.replay(arm)
        assert report.identical, report
        assert sum(run.rows for run in report) > 300


def test_a_run_in_real_time_repeats() -> None:
    choose = random.Random(2)
    name = "test-pam-replay"
    with o80.robots.load("pam").start(name, frequency=500, muscle="hill") as process:
        arm = process.frontend()
        for _ in range(60):
            act(arm, choose)
            arm.wait_for(arm.published + choose.randrange(1, 8), timeout=WAIT)
        report = o80.replay(arm)
        assert report.identical, report
        arm.close()
    o80.clean(name)


def test_another_model_of_the_muscles_differs_in_the_first_iteration() -> None:
    with o80.robots.load("pam").inline(muscle="linear") as arm:
        arm.burst(20)
        found = o80.replay(arm, options={"muscle": "hill"}).difference
        assert found is not None
        assert found.iteration <= 1


def test_a_replay_begins_with_a_reset_or_a_snapshot(muscle: str) -> None:
    choose = random.Random(4)
    with o80.robots.load("pam").inline(
        muscle=muscle, dead_time=[0.02] * 4, friction=[0.5] * 4, start_noise=0.1, history=500
    ) as arm:
        _act_and_burst(arm, choose)
        arm.request("snapshot", slot=2)
        _act_and_burst(arm, choose)
        for request, fields in (("restore", {"slot": 2}), ("reset", {"seed": 5})):
            arm.request(request, **fields)
            row = arm.published
            _act_and_burst(arm, choose)
            (run,) = o80.replay(arm, since=row)
            assert run.identical, run
            assert run.notes[0] == f"the replay begins with the {request} of row {row}"


def _act_and_burst(arm: o80.Frontend, choose: random.Random) -> None:
    for _ in range(15):
        act(arm, choose)
        arm.burst(choose.randrange(1, 12))
