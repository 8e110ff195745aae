"""The environment by the clock: pauses, late actions, the way back to the start."""

import time
from contextlib import closing

import gymnasium
import numpy as np
import pytest
from opened_environment import PUSH, STILL, WAITING, opened

import o80
from o80_table_tennis.environment import TableTennisEnvironment
from o80_table_tennis.settings import Pacing, TaskSettings


def move_on(environment: TableTennisEnvironment, rows: int) -> None:
    """Lets the arm, which has a clock of its own, get ahead of the environment."""
    arm = environment.arm
    arm.wait_for(arm.published + rows, timeout=WAITING)


def test_a_caller_who_pauses_too_long_loses_the_episode() -> None:
    task = TaskSettings(max_late=200)
    with closing(opened(Pacing.REAL_TIME, task=task)) as environment:
        environment.reset(seed=1)
        move_on(environment, 300)  # before the first step there is all the time in the world
        environment.step(STILL)
        twin = environment.twins[0].published
        move_on(environment, 201)
        observation, reward, terminated, truncated, info = environment.step(STILL)

        assert (reward, terminated, truncated) == (0.0, False, True)
        assert info["stalled"]
        assert observation in environment.observation_space
        assert environment.twins[0].published == twin
        assert environment.statistics().stalled_episodes == 1
        with pytest.raises(gymnasium.error.ResetNeeded):
            environment.step(STILL)


def test_an_action_that_comes_late_acts_at_once_and_is_counted() -> None:
    with closing(opened(Pacing.REAL_TIME)) as environment:
        environment.reset(seed=1)
        environment.step(STILL)
        k = environment.task.single.span[2]
        environment.arm.wait_for(k + 7, timeout=WAITING)
        before = environment.statistics()
        environment.step(PUSH)
        after = environment.statistics()

        assert after.late_actions == before.late_actions + 1
        assert after.largest_lateness >= 2
        assert after.steps == 2


def test_a_real_arm_goes_back_to_its_start_by_commands() -> None:
    with closing(opened(Pacing.REAL_TIME)) as environment:
        first, _ = environment.reset(seed=1)
        for _ in range(40):
            environment.step(PUSH)
        moved = environment.arm.published
        again, _ = environment.reset()
        rows = environment.arm.history(since=moved)

        assert not rows.fresh.any()  # no teleport
        assert np.abs(np.diff(rows.extended.joint_positions, axis=0)).max() < 0.05
        np.testing.assert_allclose(again[:4], first[:4], atol=0.06)


def test_an_arm_that_runs_already_can_be_attached_to() -> None:
    with o80.robots.load("pam").start(
        f"pam-test-{time.monotonic_ns()}", frequency=500.0
    ) as process:
        with closing(
            opened(Pacing.REAL_TIME, arm_segment=process.segment, attach=True)
        ) as environment:
            environment.reset(seed=1)
            environment.step(STILL)
            assert environment.statistics().steps == 1
        assert process.alive
