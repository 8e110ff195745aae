"""A learning task on two joints, run as one environment and as sixteen in one call."""

from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np
from gymnasium.spaces import Box

import o80
from o80.learning import GroupTask, Index, Outcome, register


class Reach(GroupTask):
    """Bring both joints to random goals of an episode."""

    def __init__(self, copies: int, gain: float = 30.0) -> None:
        group = o80.robots.load("two_joints").inline(copies=copies, gain=gain)
        super().__init__(
            group,
            burst=group.prepared_burst(20),  # iterations of a step
            seen=group.gather(["observed"]),
            observation_space=Box(-3, 3, (4,), np.float32),
            action_space=Box(-1, 1, (2,), np.float32),
            max_steps=50,
            reset=group.prepared_request("reset"),
        )
        self.goals = np.zeros((copies, 2))

    def begin(self, copies: Any, generators: Sequence[np.random.Generator], options: Any) -> None:
        self.goals[copies] = [generator.uniform(-1, 1, 2) for generator in generators]

    def observe(self, copies: Index) -> Any:
        return np.hstack([self.seen.observations[copies], self.goals[copies]])

    def judge(self, copies: Any) -> Outcome:
        apart = np.abs(self.seen.observations[copies] - self.goals[copies]).max(axis=1)
        return Outcome(reward=-apart, terminated=apart < 0.02)


register("mine/Reach-v0", Reach)
environments = gymnasium.make_vec("mine/Reach-v0", num_envs=16)
observations, infos = environments.reset(seed=1)
total = 0.0
for _step in range(200):
    observations, rewards, *ends = environments.step(np.clip(observations[:, 2:], -1, 1))
    total += rewards.sum()
print(f"mean reward of a step: {total / (200 * 16):.2f}")
environments.close()
