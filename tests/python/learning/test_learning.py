"""Tasks on inline groups as Gymnasium environments (o80.learning)."""

import warnings
from collections.abc import Iterator
from copy import deepcopy
from itertools import combinations
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode
from learning_tasks import Goal, Joined, Reach
from vector_equality import MODES, assert_same, beside, both

import o80
from o80.learning import Environment, VectorEnvironment, register

COPIES = 5


def random_policy(environment: VectorEnvironment, seed: int) -> Any:
    environment.action_space.seed(seed)
    return lambda seen, number: environment.action_space.sample()


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("seed", [7, 8, 9])
@pytest.mark.parametrize("task", [Reach, Goal, Joined])
def test_equals_a_sync_vector_env_of_single_ones(task: type[Reach], mode: Any, seed: int) -> None:
    with VectorEnvironment(task(COPIES, threads=2), autoreset_mode=mode) as vector:
        policy = random_policy(vector, seed)
        ends = beside(vector, lambda: Environment(task()), policy, steps=60, seed=seed)
    assert ends >= 2 * COPIES


def test_a_single_environment_passes_the_checks_of_gymnasium() -> None:
    with Environment(Reach(), render_mode="rgb_array") as environment:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            check_env(environment, skip_render_check=True)
        assert environment.render().shape == (2, 3, 3)


def test_unseeded_copies_have_generators_of_their_own() -> None:
    with VectorEnvironment(Reach(4)) as vector:
        observations, _ = vector.reset()
        assert len(set(vector.np_random_seed)) == 4
        assert len({tuple(row) for row in observations[:, 4:].tolist()}) == 4


def test_resets_copies_by_mask_seeds_and_options() -> None:
    mode = AutoresetMode.DISABLED
    make = lambda: Environment(Reach())  # noqa: E731
    singles: Any = gymnasium.vector.SyncVectorEnv([make] * 4, autoreset_mode=mode)
    with VectorEnvironment(Reach(4), autoreset_mode=mode) as vector:
        both(vector, singles, lambda each: each.reset(seed=[5, 1, 7, 7]))
        actions = np.full((4, 4), 0.01, np.float32)
        both(vector, singles, lambda each: each.step(actions))
        mask = np.array([False, True, False, True])
        options = {"reset_mask": mask, "goal": (0.25, -0.5)}
        results = both(vector, singles, lambda each: each.reset(seed=20, options=dict(options)))
        assert results[1]["steps"].tolist() == [0, 0, 0, 0]
        assert results[1]["_steps"].tolist() == mask.tolist()
        assert vector.np_random_seed == (5, 21, 7, 23)
        vector.reset(options=options)
        assert "reset_mask" in options, "the caller's options stay as they are"
        vector.reset(options={"reset_mask": mask})
    singles.close()


@pytest.mark.parametrize("mode", [AutoresetMode.SAME_STEP, AutoresetMode.NEXT_STEP])
def test_every_array_is_fresh(mode: AutoresetMode) -> None:
    with VectorEnvironment(Reach(2), autoreset_mode=mode) as vector:
        kept: list[Any] = [vector.reset(seed=1)]
        actions = np.full((2, 4), 0.2, np.float32)
        for _ in range(12):
            kept.append(vector.step(actions))
            kept.append(vector.final_observations)
        copies = deepcopy(kept)
        arrays = list(arrays_of(kept))
        assert not any(np.shares_memory(a, b) for a, b in combinations(arrays, 2))
        for _ in range(12):
            vector.step(actions)
        assert_same(kept, copies, "kept results")


def arrays_of(value: Any) -> Iterator[Any]:
    if isinstance(value, np.ndarray):
        if value.dtype != object:
            yield value
    elif isinstance(value, dict):
        for each in value.values():
            yield from arrays_of(each)
    elif isinstance(value, list | tuple):
        for each in value:
            yield from arrays_of(each)


def test_a_step_without_an_episode_is_refused() -> None:
    actions = np.zeros((3, 4), np.float32)
    with VectorEnvironment(Reach(3), autoreset_mode=AutoresetMode.DISABLED) as vector:
        with pytest.raises(ResetNeeded, match=r"all copies are without an episode: call reset"):
            vector.step(actions)
        vector.reset(seed=1, options={"reset_mask": np.array([True, False, True])})
        with pytest.raises(ResetNeeded, match=r"copy 1 is without an episode"):
            vector.step(actions)
        vector.reset(seed=1)
        for _ in range(9):
            vector.step(actions)
        with pytest.raises(ResetNeeded, match=r"reset_mask"):
            vector.step(actions)
    with (
        Environment(Reach()) as single,
        pytest.raises(ResetNeeded, match=r"call reset\(\) before step\(\)"),
    ):
        single.step(actions[0])


def test_a_step_that_raises_needs_a_reset() -> None:
    with VectorEnvironment(Reach(3)) as vector:
        vector.reset(seed=1)
        actions = np.zeros((3, 4), np.float32)
        actions[1] = np.nan
        with pytest.raises(o80.CopyFailed, match="copy 1"):
            vector.step(actions)
        with pytest.raises(ResetNeeded):
            vector.step(np.zeros((3, 4), np.float32))
        vector.reset()
        vector.step(np.zeros((3, 4), np.float32))


def test_a_reset_that_fails_beside_the_steps_of_others_raises() -> None:
    with VectorEnvironment(Joined(3)) as environments:
        environments.reset(seed=1)
        task: Any = environments.task
        stay, reset = np.zeros((3, 4), np.float32), task.reset
        while not np.logical_or(*environments.step(stay)[2:4]).any():
            pass
        task.reset = task.group.prepared_request("restore", slot=9)  # there are slots 0 to 7
        with pytest.raises(o80.CopyFailed, match="'restore' was not completed"):
            environments.step(stay)
        task.reset = reset
        with pytest.raises(gymnasium.error.ResetNeeded):
            environments.step(stay)
        environments.reset(seed=2)
        environments.step(stay)


def test_mistakes_are_named() -> None:
    with VectorEnvironment(Reach(3)) as vector:
        with pytest.raises(o80.InvalidArgument, match=r"one for each of the 3 copies, got 2"):
            vector.reset(seed=[1, 2])
        with pytest.raises(o80.InvalidArgument, match="reset_mask must be an array of 3 bools"):
            vector.reset(options={"reset_mask": [True, False, True]})
        with pytest.raises(o80.InvalidArgument, match="true for at least one copy"):
            vector.reset(options={"reset_mask": np.zeros(3, np.bool_)})
        vector.reset(seed=1)
        with pytest.raises(o80.InvalidArgument, match=r"actions must have the shape \(3, 4\)"):
            vector.step(np.zeros(4))
        with pytest.raises(o80.InvalidArgument, match="an Environment has one copy"):
            Environment(vector.task)
        with pytest.raises(o80.InvalidArgument, match="'NextStep', 'SameStep', 'Disabled'"):
            VectorEnvironment(vector.task, autoreset_mode="Next")
        with pytest.raises(o80.InvalidArgument, match="one of the task's \\(rgb_array\\)"):
            VectorEnvironment(vector.task, render_mode="human")


def test_what_judge_returns_is_checked() -> None:
    class Wrong(Reach):
        def judge(self, copies: Any) -> Any:
            return np.zeros(len(copies))

    with Environment(Wrong(max_steps=1)) as environment:
        environment.reset(seed=1)
        with pytest.raises(o80.InvalidArgument, match=r"Wrong\.judge must return an .*Outcome"):
            environment.step(np.zeros(4, np.float32))


def test_gymnasium_makes_a_registered_task() -> None:
    register("o80-test/Reach-v0", Reach)
    try:
        with gymnasium.make("o80-test/Reach-v0", max_steps=3) as single:
            single.reset(seed=1)
            assert [single.step(np.zeros(4, np.float32))[3] for _ in range(3)] == [0, 0, 1]
        vector = gymnasium.make_vec("o80-test/Reach-v0", num_envs=3, autoreset_mode="SameStep")
        assert isinstance(vector, VectorEnvironment)
        assert vector.metadata["autoreset_mode"] is AutoresetMode.SAME_STEP
        vector.close()
        assert isinstance(vector.task, Reach)
        assert vector.task.group.closed
    finally:
        del gymnasium.registry["o80-test/Reach-v0"]
