"""Tasks are exchanged without touching the environment: the named ones, and a user's own."""

from contextlib import closing
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from o80_table_tennis.environment import TableTennisEnvironment
from o80_table_tennis.players.policies import default_policy
from o80_table_tennis.settings import TaskSettings
from o80_table_tennis.task.actions import COARSE
from o80_table_tennis.task.ball_play import ReturnTask
from o80_table_tennis.task.state import State
from o80_table_tennis.world.arm import MUSCLES

STILL = np.zeros(MUSCLES, dtype=np.float32)


@dataclass(frozen=True)
class KeepStillTask(ReturnTask):
    """A user's own: each step costs the speed of the arm, whatever the ball does."""

    uncopied: Any = (letter for letter in "uncopied")

    def eventful(self, state: State) -> Any:
        return np.ones(np.shape(state.steps), np.bool_)

    def reward(self, state: State) -> Any:
        return -np.abs(state.joint_velocities).sum(axis=-1)

    def info(self, state: State) -> dict[str, Any]:
        return {"asked": state.asked}


def played(
    task: str | ReturnTask, *, seed: int = 1, scripted: bool = True
) -> tuple[list[float], dict[str, Any]]:
    """Rewards and last info of an episode."""
    settings, rewards, policy = TaskSettings(task=task, factor=COARSE), [], default_policy()
    with closing(TableTennisEnvironment(task=settings)) as environment:
        observation, _ = environment.reset(seed=seed)
        over = False
        while not over:
            action = policy.act(observation) if scripted else STILL
            observation, reward, terminated, truncated, info = environment.step(action)
            rewards.append(reward)
            over = terminated or truncated
        assert environment.summary.reward == pytest.approx(sum(rewards))
    return rewards, info


def test_a_smash_is_the_return_times_the_speed_of_the_ball() -> None:
    returned, _ = played("return")
    smashed, info = played("smash")
    assert len(returned) == len(smashed)
    assert 1.5 < returned[-1] <= 2.0
    assert smashed[-1] - 1.0 == pytest.approx(info["speed"] * (returned[-1] - 1.0))
    assert info["speed"] > 3.0


def test_a_users_own_task_is_paid_in_every_step() -> None:
    rewards, info = played(KeepStillTask())
    assert sum(reward < 0 for reward in rewards) > len(rewards) / 2
    assert info["asked"].shape == (MUSCLES,)
    assert "touched" not in info


def test_a_task_is_told_what_was_asked_for() -> None:
    with closing(TableTennisEnvironment(task=TaskSettings(task=KeepStillTask()))) as environment:
        _, info = environment.reset(seed=1)
        before = info["asked"].copy()
        *_, info = environment.step(np.ones(MUSCLES, np.float32))
        desired = environment.task.commanded()[0]
    assert np.all(info["asked"] > before)
    np.testing.assert_allclose(info["asked"], desired, atol=1e-4)


def test_an_observation_of_ones_own_is_not_replaced_in_silence() -> None:
    class Blind(ReturnTask):
        def observe(self, state: State) -> Any:
            return state.motion

    with pytest.raises(ValueError, match="Blind has an `observe` of its own"):
        TaskSettings(task=Blind(), observation="full")
    TaskSettings(task=KeepStillTask(), observation="full")
