"""Tasks are exchanged without touching the environment: the named ones, and a user's own."""

import warnings
from contextlib import closing
from dataclasses import dataclass
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import o80_table_tennis
from o80_table_tennis.environment import TableTennisEnvironment
from o80_table_tennis.players.policies import default_policy
from o80_table_tennis.settings import TASKS, RigSettings, TaskSettings
from o80_table_tennis.task.actions import COARSE
from o80_table_tennis.task.ball_play import ReturnTask
from o80_table_tennis.task.end import End, EndRule
from o80_table_tennis.task.reach import ReachTask
from o80_table_tennis.task.state import State
from o80_table_tennis.task.task import Task
from o80_table_tennis.world.arm import MUSCLES, PLAYING_POSTURE, racket_pose

STILL = np.zeros(MUSCLES, dtype=np.float32)


@dataclass(frozen=True)
class KeepStillTask(ReturnTask):
    """A user's own: each step costs the speed of the arm, whatever the ball does."""

    def eventful(self, state: State) -> Any:
        return np.ones(np.shape(state.steps), np.bool_)

    def reward(self, state: State) -> Any:
        return -np.abs(state.joint_velocities).sum(axis=-1)

    def info(self, state: State) -> dict[str, Any]:
        return {"speed": -self.reward(state)}


def played(
    task: str | Task, *, seed: int = 1, scripted: bool = True
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


@pytest.mark.parametrize("task", [*TASKS, KeepStillTask()])
def test_gymnasium_accepts_every_task(task: str | Task) -> None:
    settings = TaskSettings(task=task)
    environment = gymnasium.make(o80_table_tennis.ACCELERATED, task=settings)
    with closing(environment), warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)
        check_env(environment.unwrapped, skip_render_check=True)
    assert isinstance(settings.made(), Task)


def test_a_smash_is_the_return_times_the_speed_of_the_ball() -> None:
    returned, _ = played("return")
    smashed, _ = played("smash")
    assert len(returned) == len(smashed)
    assert 1.5 < returned[-1] <= 2.0
    assert smashed[-1] - 1.0 > 3.0 * (returned[-1] - 1.0)


def test_a_hit_ends_with_the_touch_and_is_worth_one() -> None:
    rewards, info = played("hit")
    returned, _ = played("return")
    assert rewards[-1] == 1.0
    assert (info["touched"], info["end"], info["end_text"]) == (True, End.GOAL, "goal")
    assert len(rewards) < len(returned)
    rewards, info = played("hit", scripted=False, seed=3)
    assert rewards[-1] == -info["smallest_distance"]


def test_extra_balls_are_judged_by_the_task_too() -> None:
    settings = TaskSettings(task="hit", factor=COARSE)
    policy = default_policy()
    with closing(TableTennisEnvironment(rig=RigSettings(extra_balls=40), task=settings)) as env:
        observation, info = env.reset(seed=2)
        paid, over = np.zeros(40), False
        while not over:
            observation, _, terminated, truncated, info = env.step(policy.act(observation))
            paid += info["virtual"]["rewards"]
            over = terminated or truncated
    touched, truncated = info["virtual"]["touched"], info["virtual"]["truncated"]
    assert touched.any()
    np.testing.assert_array_equal(paid[touched], 1.0)
    assert info["virtual"]["ended"].all()
    assert (truncated & ~touched).any()
    np.testing.assert_array_equal(paid[truncated], 0.0)
    assert np.all(paid[~touched & ~truncated] < 0)


def test_a_users_own_task_is_paid_in_every_step() -> None:
    rewards, info = played(KeepStillTask())
    assert sum(reward < 0 for reward in rewards) > len(rewards) / 2
    assert "speed" in info
    assert "touched" not in info


class TestReach:
    def test_each_step_costs_the_distance_from_the_goal(self) -> None:
        settings = TaskSettings(task="reach", end=EndRule(max_steps=20))
        with closing(TableTennisEnvironment(task=settings)) as environment:
            observation, info = environment.reset(seed=2)
            np.testing.assert_allclose(observation[19:22], info["goal"], rtol=1e-6)
            for step in range(1, 21):
                observation, reward, terminated, truncated, info = environment.step(STILL)
                apart = np.linalg.norm(observation[16:19] - observation[19:22])
                assert reward == -info["distance"] == pytest.approx(-apart, abs=1e-6)
                assert (terminated, truncated) == (False, step == 20)

    def test_goals_follow_the_seed_and_can_be_reached(self) -> None:
        task = ReachTask()
        goals = [task.begin(np.random.default_rng(seed)) for seed in (1, 2, 1)]
        np.testing.assert_array_equal(goals[0], goals[2])
        assert np.linalg.norm(goals[0] - goals[1]) > 0.01

    def test_a_racket_that_rests_at_the_goal_has_reached_it(self) -> None:
        there = np.array(racket_pose(np.array(PLAYING_POSTURE)).position)
        fast, slow = np.full(8, 0.6), np.full(8, 0.4)
        rows = [
            (slow, there, 1),
            (fast, there, 1),
            (slow, there + 0.1, 1),
            (slow, there + 0.1, 300),
        ]
        ends = [End.GOAL, End.RUNNING, End.RUNNING, End.OUT_OF_STEPS]
        motion, racket, steps = (np.array([row[place] for row in rows]) for place in range(3))
        goal, nothing = np.tile(there, (4, 1)), np.zeros((4, 8))
        state = State(steps, motion, nothing, racket, nothing[:, :6], None, goal)  # type: ignore[arg-type]

        np.testing.assert_array_equal(ReachTask().end(state), ends)
        assert ReachTask().observe(state).shape == (4, 22)
        np.testing.assert_allclose(ReachTask().reward(state), [0, 0, -(0.03**0.5), -(0.03**0.5)])

    def test_it_has_no_balls(self) -> None:
        with pytest.raises(ValueError, match="plays no ball: extra_balls must be 0, got 2"):
            TableTennisEnvironment(rig=RigSettings(extra_balls=2), task=TaskSettings(task="reach"))
        environment = TableTennisEnvironment(task=TaskSettings(task="reach"))
        with closing(environment), pytest.raises(ValueError, match="ball; reset knows no option"):
            environment.reset(options={"ball": 1})
