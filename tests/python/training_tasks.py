"""Tasks for the tests of o80.learning.training."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import gymnasium
import numpy as np
from gymnasium.spaces import Box
from gymnasium.vector import SyncVectorEnv

import o80
from o80.learning import GroupTask, Outcome, Task, register

events: list[str] = []
"""Calls of the task OnTheClock."""
interruptions: Iterator[bool] = iter(())
"""Flags: whether each next step of Guess is interrupted."""


class Guess(gymnasium.Env[Any, Any]):
    """Episodes of three steps: the action must be 5 plus twice the observed number."""

    observation_space = Box(-1, 1, (1,), np.float32)
    action_space = Box(0, 10, (1,), np.float32)

    def __init__(self, rule: Any = None, offset: float = 0.0) -> None:
        self._rule, self._offset = rule, offset

    def reset(self, *, seed: int | None = None, options: Any = None) -> Any:
        super().reset(seed=seed)
        self._steps, self._largest = 0, 0.0
        return self._drawn(), {}

    def _drawn(self) -> Any:
        self._number = self.np_random.uniform(-1, 1, 1).astype(np.float32)
        return self._number

    def step(self, action: Any) -> Any:
        if next(interruptions, False):
            raise KeyboardInterrupt
        assert self.action_space.contains(action)
        apart = abs(float(action[0]) - 5.0 - 2.0 * float(self._number[0]) - self._offset)
        self._steps, self._largest = self._steps + 1, max(self._largest, apart)
        reward = -apart if self._rule is None else self._rule(apart)
        over = self._steps == 3
        return self._drawn(), reward, over, False, {"is_success": self._largest < 1} if over else {}


class Squared:
    """User-defined reward rule."""

    def __call__(self, apart: float) -> float:
        return -(apart**2)


class NeedsMore:
    """Invalid rule: its constructor needs an argument."""

    def __init__(self, more: int) -> None:
        self.more = more


class Words(gymnasium.Env[Any, Any]):
    """Task with discrete actions, which no Gaussian policy supports."""

    observation_space = Box(-1, 1, (1,), np.float32)
    action_space = gymnasium.spaces.Discrete(2)


class OfItsOwn:
    """Class with a `make_vec` method."""

    @classmethod
    def make_vec(cls, copies: int, *, autoreset_mode: Any, **options: Any) -> Any:
        return SyncVectorEnv([lambda: Guess(**options)] * copies, autoreset_mode=autoreset_mode)


def three(copies: int, **options: Any) -> Any:
    """Makes three copies, whatever the number requested."""
    return OfItsOwn.make_vec(3, autoreset_mode="SameStep", **options)


class Near(GroupTask):
    """Copies of two joints, which should both be at 0.5 rad."""

    def __init__(self, copies: int, max_steps: int = 8) -> None:
        group = o80.robots.load("two_joints").inline(copies=copies)
        super().__init__(
            group,
            burst=group.prepared_burst(20),
            seen=group.gather(["observed"]),
            observation_space=Box(-3, 3, (2,), np.float32),
            action_space=Box(-1, 1, (2,), np.float32),
            max_steps=max_steps,
        )

    def begin(self, copies: Any, generators: Any, options: Any) -> None:
        self.group.request("reset", copies=copies)

    def judge(self, copies: Any) -> Outcome:
        return Outcome(-np.abs(self.seen.observations[copies] - 0.5).max(axis=1))


register("training_tasks/Near-v0", Near)


class OnTheClock(Task):
    """Two joints in another process, in real time: a step takes 20 iterations."""

    def __init__(self, copies: int, segment: str = "") -> None:
        space = Box(-1, 1, (2,), np.float32)
        super().__init__(copies, observation_space=space, action_space=space, max_steps=5)
        self._process = o80.robots.load("two_joints").start(segment)
        self._arm = self._process.frontend()
        self.robots = (self._arm,)

    def begin(self, copies: Any, generators: Any, options: Any) -> None:
        events.append("begin")
        self._row = self._arm.latest()

    def step(self, actions: Any, copies: Any) -> None:
        events.append("step")
        for joint, target in zip(("shoulder", "elbow"), actions[0], strict=True):
            self._arm.add_command(joint, float(target), iterations=20, mode="overwrite")
        self._arm.pulse()
        self._row = self._arm.wait_for(self._row.iteration + 20, timeout=60.0)

    def observe(self, copies: Any) -> Any:
        return np.clip([self._row.observed], -1, 1)

    def judge(self, copies: Any) -> Outcome:
        apart = float(np.abs(np.asarray(self._row.observed) - 0.5).max())
        return Outcome(-apart, info={"is_success": [apart < 0.1]})

    def close(self) -> None:
        self._arm.close()
        self._process.stop()
