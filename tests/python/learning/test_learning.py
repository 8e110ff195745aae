"""Tasks on inline groups as Gymnasium environments (o80.learning)."""

import os
import warnings
from collections.abc import Iterator
from contextlib import closing
from copy import deepcopy
from dataclasses import dataclass
from itertools import combinations
from typing import Any, ClassVar

import gymnasium
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.spaces import Box
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode
from learning_tasks import Goal, Joined, Reach
from vector_equality import MODES, assert_same, beside, both

import o80
from o80.drivers import Desired, Reading
from o80.learning import Environment, GroupTask, Outcome, Task, VectorEnvironment, register

COPIES = 5


def random_policy(environment: VectorEnvironment, seed: int) -> Any:
    environment.action_space.seed(seed)
    return lambda seen, number: environment.action_space.sample()


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("seed", [7, 8])
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


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (np.zeros(3), r"Wrong\.judge must return an .*Outcome"),
        (Outcome(reward=np.ones((3, 1))), "judge must give reward as one value, or one for each"),
        (Outcome(reward="high"), "one for each of the 3 judged copies, got 'high'"),
        (Outcome(terminated=[True, False]), r"give terminated as .* got \[True, False\]"),
        (Outcome(truncated=np.zeros((3, 3))), "judge must give truncated as one value"),
        (Outcome(reward=[0.0, np.inf, 0.0]), "gave copy 1 the reward inf: it must be finite"),
        (Outcome(reward=float("nan")), "gave copy 0 the reward nan"),
    ],
)
def test_what_judge_returns_is_checked(given: Any, message: str) -> None:
    class Wrong(Reach):
        def judge(self, copies: Any) -> Any:
            return given

    with VectorEnvironment(Wrong(3, max_steps=1)) as environment:
        environment.reset(seed=1)
        with pytest.raises(o80.InvalidArgument, match=message):
            environment.step(np.zeros((3, 4), np.float32))


def test_actions_of_any_number_of_axes_are_clipped() -> None:
    with closing(Reach(2)) as task:
        for shape in ((4,), (1, 4), (2, 4), (2, 5, 4), (7, 4)):
            assert task.clipped(np.full(shape, 9.0)).tolist() == np.ones(shape).tolist()
        task.action_space = Box(-2, 2, (4,), np.float32)
        assert task.clipped([[9, -9, 0, 1]] * 2).tolist() == [[2, -2, 0, 1]] * 2


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


# ---------------------------- halts of copies: one ends the episode of its copy, a reset resumes it


SPACE = Box(-1, 1, (2,), np.float32)


class Colliding:
    """Two joints between walls: one that is pushed against a wall halts by its error limit."""

    actuators = ("left", "right")
    limits: ClassVar = dict.fromkeys(
        actuators,
        o80.Limits(minimum=-1.0, maximum=1.0, speed=20.0, acceleration=4000.0, error=0.15),
    )
    extended: ClassVar = {"pushed": (float, 2)}
    requests: ClassVar[dict[str, None]] = {"reset": None}
    while_halted = ("reset",)
    simulated = True

    @dataclass
    class Config:
        stuck: float = 10.0  # a joint that is pushed further beyond a wall refuses to resume

    def __init__(self, config: Config) -> None:
        self.stuck = config.stuck
        self.desired = np.zeros(2)

    def write(self, desired: Desired) -> None:
        self.desired = np.array(desired.states)

    def read(self, reading: Reading) -> None:
        reading.observed = np.clip(self.desired, -0.5, 0.5)
        reading.extended = {"pushed": self.desired - reading.observed}

    def resume(self) -> None:
        if abs(self.desired[0]) - 0.5 > self.stuck:
            raise o80.RequestRejected("it is stuck")

    def on_reset(self, _: o80.Record) -> o80.StartAfresh:
        self.desired = np.zeros(2)
        return o80.StartAfresh()


class Push(GroupTask):
    """The error limit acts at large actions."""

    def __init__(self, copies: int = 1, **options: Any) -> None:
        group = o80.robots.load(Colliding).inline(copies=copies, threads=2, **options)
        super().__init__(
            group,
            burst=group.prepared_burst(40),
            seen=group.gather(["observed", "extended"]),
            observation_space=Box(-9, 9, (4,), np.float32),
            action_space=SPACE,
            max_steps=7,
        )

    def begin(self, copies: Any, generators: Any, options: Any) -> None:
        self.group.request("reset", copies=copies)

    def judge(self, copies: Any) -> Outcome:
        reward = -np.abs(self.seen.observations[copies]).sum(axis=1)
        return Outcome(reward, info={"halted": [copy in self.halts for copy in copies.tolist()]})


def actions(*halting: int) -> Any:
    """Actions of all copies; the first joints of some are pushed against a wall."""
    given = np.full((COPIES, 2), 0.3, np.float32)
    given[list(halting), 0] = 0.9
    return given


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("seed", [3, 4])
def test_equals_a_sync_vector_env_where_copies_halt(mode: Any, seed: int) -> None:
    halts = 0
    with VectorEnvironment(Push(COPIES), autoreset_mode=mode) as vector:
        vector.action_space.seed(seed)
        task: Any = vector.task

        def policy(seen: Any, number: int) -> Any:
            nonlocal halts
            halts += len(task.halts)
            return vector.action_space.sample() * np.float32(0.9)

        ends = beside(vector, lambda: Environment(Push()), policy, steps=60, seed=seed)
    assert halts > 10
    assert ends > halts / 2


def test_the_others_go_on_as_if_nothing_had_been() -> None:
    with (
        VectorEnvironment(Push(COPIES)) as one,
        VectorEnvironment(Push(COPIES)) as two,
    ):
        for each in (one, two):
            each.reset(seed=1)
        for step in range(20):
            halting, calm = one.step(actions(*[2] * (step % 3 == 1))), two.step(actions())
            others = np.arange(COPIES) != 2
            for mine, other in zip(halting[:4], calm[:4], strict=True):
                assert mine[others].tobytes() == other[others].tobytes()
            if step == 1:
                assert halting[2].tolist() == [False, False, True, False, False]
                assert "error limit of 0.15" in halting[4]["halt"][2]
                assert halting[4]["halted"].tolist() == [False, False, True, False, False]


def test_a_copy_that_may_not_be_resumed_fails_alone() -> None:
    with VectorEnvironment(Push(COPIES, stuck=0.1), autoreset_mode="SameStep") as vector:
        vector.reset(seed=1)
        with pytest.raises(o80.CopyFailed, match="it is stuck") as failed:
            vector.step(actions(3))
        assert [*failed.value.errors] == [3]
        task: Any = vector.task
        task.group.request("reset", copies=[3])  # it may be resumed then
        vector.reset(options={"reset_mask": np.arange(COPIES) == 3})
        vector.step(actions())
        assert task.steps.tolist() == [2, 2, 2, 1, 2]
    with Environment(Push(stuck=0.1)) as single:
        single.reset(seed=1)
        assert single.step(actions(0)[0])[2]
        with pytest.raises(o80.CopyFailed, match="it is stuck"):
            single.reset()


class Pushes(Task):
    """One robot in this process or in another one, moved by the frontend."""

    def __init__(self, arm: o80.Frontend) -> None:
        super().__init__(1, observation_space=Box(-9, 9, (2,), np.float64), action_space=SPACE)
        self.arm = arm
        self.robots = (arm,)

    def begin(self, copies: Any, generators: Any, options: Any) -> None:
        self.arm.request("reset")

    def step(self, actions: Any, copies: Any) -> None:
        self.arm.add_command(None, actions[0], iterations=20)
        self.arm.pulse_and_wait(timeout=60) if not self.arm.bursting else self.arm.burst(40)

    def observe(self, copies: Any) -> Any:
        return np.array(self.arm.latest().observed)[None]

    def judge(self, copies: Any) -> Outcome:
        return Outcome()


@pytest.mark.parametrize("bursting", [True, False])
def test_a_reset_ends_halts_of_the_robot_and_none_that_was_requested(bursting: bool) -> None:
    segment = f"test-{os.getpid()}-halted"
    options: dict[str, Any] = {"segment": segment, "frequency": 500.0, "bursting": bursting}
    with o80.robots.load(Colliding).start(**options) as process, process.frontend() as arm:
        environment = Environment(Pushes(arm))
        environment.reset(seed=1)
        _, _, terminated, _, info = environment.step(actions(0)[0])
        assert terminated
        assert "error limit" in info["halt"]
        environment.reset()
        assert not environment.step(actions()[0])[2]
        number = o80.halt(segment, "the ball is on the floor")
        if bursting:
            arm.burst(1)
        _, _, terminated, _, info = environment.step(actions()[0])
        assert (terminated, info["halt"]) == (True, "the ball is on the floor")
        with pytest.raises(o80.CopyFailed, match=f"on the floor.*o80 resume {segment} {number}"):
            environment.reset()
        assert arm.halted is not None
        arm.resume(number)
        environment.reset()
        assert not environment.step(actions()[0])[2]
