"""Each ball of a motion has the episode that it would have if it were played by these actions."""

from contextlib import closing
from dataclasses import replace

import numpy as np
import pytest

from o80_table_tennis.environment import TableTennisEnvironment
from o80_table_tennis.learning.virtual.motions import Motion, Motions
from o80_table_tennis.players.hitting_policy import HittingPolicy
from o80_table_tennis.settings import Pacing, RigSettings, TaskSettings
from o80_table_tennis.task.actions import COARSE

STILL = np.zeros(8, np.float32)
BALLS = 12
RIG = RigSettings(start_noise=0.02)
TASK = TaskSettings(balls="wide", factor=COARSE)


def played(task: TaskSettings, *, seed: int, balls: int = BALLS) -> Motion:
    """A motion of the scripted policy."""
    policy = HittingPolicy()
    with Motions(balls, rig=RIG, task=task) as motions:
        return motions.play(policy.act, np.random.default_rng(seed))


def repeated(motion: Motion, task: TaskSettings) -> Motion:
    """A motion of the same actions, whatever is observed."""
    actions = iter([*motion.actions, *[STILL] * task.end.max_steps])
    with Motions(BALLS, rig=RIG, task=task) as motions:
        return motions.play(lambda _: next(actions), np.random.default_rng(3))


def environment(task: TaskSettings, *, balls: int) -> TableTennisEnvironment:
    return TableTennisEnvironment(rig=replace(RIG, extra_balls=balls - 1), task=task)


@pytest.mark.parametrize("observation", ["published", "full"])
def test_each_ball_has_exactly_the_episode_of_a_played_one(observation: str) -> None:
    task = replace(TASK, observation=observation)
    # the scripted policy wants the published observation
    motion = repeated(played(TASK, seed=3), task)
    assert motion.touched.any()
    assert not motion.touched.all()
    with closing(environment(task, balls=BALLS)) as single:
        for ball, number in enumerate(motion.balls.tolist()):
            seen, _ = single.reset(seed=3, options={"ball": number})
            length = int(motion.lengths[ball])
            for step in range(length):
                assert np.array_equal(seen, motion.observations[step, ball])
                seen, reward, terminated, truncated, info = single.step(motion.actions[step])
                assert np.float32(reward) == motion.rewards[step, ball]
                assert (terminated or truncated) == (step == length - 1)
            assert np.array_equal(seen, motion.observations[length, ball])
            assert terminated == motion.terminated[ball]
            assert info["touched"] == motion.touched[ball]
            assert info["returned"] == motion.returned[ball]
            assert not motion.rewards[length:, ball].any()


def test_flying_out_ends_each_episode_at_the_touch_with_all_that_is_paid() -> None:
    at_touch = played(replace(TASK, fly_out=True), seed=3)
    through = repeated(at_touch, TASK)
    assert at_touch.paid == pytest.approx(through.paid, abs=1e-6)
    touched = at_touch.touched
    assert np.array_equal(touched, through.touched)
    assert np.array_equal(at_touch.returned, through.returned)
    assert np.array_equal(at_touch.lengths[~touched], through.lengths[~touched])
    assert (at_touch.lengths[touched] < through.lengths[touched]).all()
    for ball, length in enumerate(at_touch.lengths.tolist()):
        assert not at_touch.rewards[length:, ball].any()
        assert at_touch.rewards[length - 1, ball] == at_touch.paid[ball]


def test_a_ball_that_flies_out_is_paid_as_in_the_environment() -> None:
    task = replace(TASK, fly_out=True)
    rig = replace(RIG, start_noise=0.0)
    with Motions(BALLS, rig=rig, task=task) as motions:
        motion = motions.play(HittingPolicy().act, np.random.default_rng(3))
    assert motion.touched.any()
    with closing(TableTennisEnvironment(rig=rig, task=task)) as single:
        for ball, number in enumerate(motion.balls.tolist()):
            single.reset(seed=3, options={"ball": number})
            for action in motion.actions[: motion.lengths[ball]]:
                _, reward, terminated, _, info = single.step(action)
            assert terminated == motion.terminated[ball]
            assert reward == pytest.approx(motion.paid[ball], abs=0.02)
            assert info["returned"] == motion.returned[ball]


def test_a_motion_is_repeated_by_its_generator() -> None:
    first, second = (played(TASK, seed=5, balls=3) for _ in range(2))
    assert first.observations.tobytes() == second.observations.tobytes()
    assert first.rewards.tobytes() == second.rewards.tobytes()
    assert np.array_equal(first.balls, second.balls)


def test_the_policy_sees_the_played_ball_only_and_is_not_asked_after_its_episode() -> None:
    seen: list[np.ndarray] = []

    def watch(observation: np.ndarray) -> np.ndarray:
        seen.append(observation.copy())
        return np.zeros(8, np.float32)

    with Motions(3, rig=RIG, task=TASK) as motions:
        motion = motions.play(watch, np.random.default_rng(0))
    assert len(seen) == motion.lengths[0]
    assert np.array_equal(np.array(seen), motion.observations[: len(seen), 0])
    assert len(motion.actions) == motion.lengths.max()


@pytest.mark.parametrize(
    ("rig", "task", "message"),
    [
        (RigSettings(pacing=Pacing.PROCESSES), TASK, r"motions need RigSettings\(pacing=Pacing.IN"),
        (RigSettings(twins=2), TASK, r"motions need .*twins=1"),
        (RIG, TaskSettings(task="reach"), "need a task that plays a ball"),
    ],
)
def test_what_motions_cannot_do_is_refused(
    rig: RigSettings, task: TaskSettings, message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        Motions(2, rig=rig, task=task)
