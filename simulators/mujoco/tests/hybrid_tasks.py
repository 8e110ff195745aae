"""Tasks for the tests of o80.hybrid: an arm pushes a puck, or one arm follows another."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from gymnasium.spaces import Box
from numpy.typing import NDArray

import o80
from o80.hybrid import HybridTask, Mirror, Outcome, Rig, difference

RATE = 200  # iterations a second
START = np.array([0.4, 0.15])  # of the puck


class Push(HybridTask):
    """Bring the puck to a random goal; an episode ends after a random number of steps."""

    rig = Rig(
        robot="two_joints",
        world="mujoco",
        world_options={"model": "models/push.xml"},
        mirror=Mirror(velocity=difference(3)),
        every=5,
        frequency=RATE,
    )
    action_space = Box(-1, 1, (2,), np.float32)
    robot_numbers = ("observed",)
    world_numbers = ("puck_position", "puck_velocity")
    max_steps = 30
    home_duration = 0.5
    ends = True  # by itself, at random

    def prepare(self) -> None:
        self.goal = np.zeros((self.copies, 2))
        self.last_step = np.full(self.copies, 99)

    def begin(self, copies: Any, generators: Any, options: Any) -> None:
        self.goal[copies] = [each.uniform(-0.5, 0.5, 2) for each in generators]
        drawn = [each.integers(3, 50) for each in generators]
        self.last_step[copies] = drawn if self.ends else 99

    def observe(self, copies: Any) -> Any:
        return np.hstack([super().observe(copies), self.goal[copies]])

    def judge(self, copies: Any) -> Outcome:
        puck = self.world.last["extended"]["puck_position"][copies, 0, :2]
        apart = np.linalg.norm(puck - self.goal[copies], axis=1)
        return Outcome(-apart, terminated=self.steps[copies] >= self.last_step[copies])


class Many(Push):
    """Push in many worlds, each with its own goal, end and place of the puck."""

    rig = replace(Push.rig, worlds=1)
    only: int | None = None  # of `drawn` worlds, as if it were alone
    drawn = 4

    def prepare(self) -> None:
        self.goal = np.zeros((self.copies, self.worlds, 2))
        self.last_step = np.full((self.copies, self.worlds), 99)

    def begin(self, copies: Any, generators: Any, options: Any) -> None:
        chosen = [*range(self.worlds)] if self.only is None else [self.only]
        goals = [each.uniform(-0.5, 0.5, (self.drawn, 2))[chosen] for each in generators]
        ends = [each.integers(3, 50, self.drawn)[chosen] for each in generators]
        self.goal[copies], self.last_step[copies] = goals, ends if self.ends else 99
        if self.world.simulated:
            place = np.full((len(copies), self.worlds, 3), 0.05)
            place[..., :2] = START + 0.1 * self.goal[copies]
            self.world.request("place", copies, body="puck", position=place)

    def observe(self, copies: Any) -> Any:
        return np.concatenate([HybridTask.observe(self, copies), self.goal[copies]], -1)

    def judge(self, copies: Any) -> Outcome:
        puck = self.world.last["extended"]["puck_position"][copies, :, :2]
        apart = np.linalg.norm(puck - self.goal[copies], axis=-1)
        return Outcome(-apart, self.steps[copies][:, np.newaxis] >= self.last_step[copies])


class Still(Many):
    """Begins at the state of a reset, in real time as inline."""

    def go_home(self, robot: o80.Frontend) -> None:
        if robot.schema["requests"]:
            robot.request("reset", seed=0)


class Followed(HybridTask):
    """A simulated arm follows another one: a world without a velocity, in another process."""

    rig = Rig(robot="two_joints", world="two_joints", every=4, frequency=RATE)
    action_space = Box(-1, 1, (2,), np.float32)
    robot_numbers = ("observed",)
    world_numbers = ("effort",)
    flags = ("world.effort[0] > 0.1", "robot.observed.elbow < -0.5")

    def begin(self, copies: Any, generators: Any, options: Any) -> None:
        pass

    def judge(self, copies: Any) -> Outcome:
        return Outcome(1.0)


def played(environment: Any, steps: int, seed: int) -> Iterator[NDArray[np.float64]]:
    """Plays random actions for `steps` steps, with a reset after each end; returns the results."""
    random = np.random.default_rng(seed)
    shape = environment.action_space.shape
    observation, _ = environment.reset(seed=seed)
    yield observation.astype(np.float64)
    for _ in range(steps):
        action = random.uniform(-1, 1, shape).astype(np.float32)
        observation, reward, terminated, truncated, _ = environment.step(action)
        yield np.array([*observation, reward, terminated, truncated], np.float64)
        if terminated or truncated:
            observation, _ = environment.reset()
            yield observation.astype(np.float64)
