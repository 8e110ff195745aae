"""Runs of the simulated arm repeat bit for bit, and a changed plant is found where it acts."""

import random
from typing import Any

import pytest

import o80

WAIT = 60.0  # [s] longer than any wait should take


def act(arm: o80.Frontend, choose: random.Random) -> None:
    """What a learner does: targets that overwrite each other, late ones, resets, snapshots."""
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
