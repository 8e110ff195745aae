"""Halts of copies in environments: one ends the episode of its copy, a reset resumes it."""

import os
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import pytest
from gymnasium.spaces import Box
from vector_equality import MODES, beside

import o80
from o80.drivers import Desired, Reading
from o80.learning import Environment, GroupTask, Outcome, Task, VectorEnvironment

COPIES = 5
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
