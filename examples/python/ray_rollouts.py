"""Rollouts of a task collected by several processes at once: each process is an actor of Ray.

Needs `pip install "o80[ray]"`.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import ray
from gymnasium.spaces import Box

import o80
from o80.learning import GroupTask, Index, Outcome, VectorEnvironment
from o80.learning.rollouts import Collector, GaussianPolicy

PROCESSES = 2


class Reach(GroupTask):
    """Bring both joints to goals that are drawn for each episode."""

    def __init__(self, copies: int) -> None:
        group = o80.robots.load("two_joints").inline(copies=copies, threads=1, gain=30.0)
        super().__init__(
            group,
            burst=group.prepared_burst(20),
            seen=group.gather(["observed"]),
            observation_space=Box(-3, 3, (4,), np.float32),
            action_space=Box(-1, 1, (2,), np.float32),
            max_steps=50,
        )
        self.goals = np.zeros((copies, 2))

    def begin(self, copies: Any, generators: Sequence[np.random.Generator], options: Any) -> None:
        self.goals[copies] = [generator.uniform(-1, 1, 2) for generator in generators]
        self.group.request("reset", copies=copies)

    def observe(self, copies: Index) -> Any:
        return np.hstack([self.seen.observations[copies], self.goals[copies]])

    def judge(self, copies: Any) -> Outcome:
        apart = np.abs(self.seen.observations[copies] - self.goals[copies]).max(axis=1)
        return Outcome(reward=-apart, terminated=apart < 0.02)


def make() -> VectorEnvironment:
    """The copies of one process."""
    return VectorEnvironment(Reach(copies=8), autoreset_mode="SameStep")


# on several machines: `ray start` on each of them, and ray.init(address="auto") here
ray.init(num_cpus=PROCESSES, object_store_memory=100 << 20, include_dashboard=False)
Actor = ray.remote(num_cpus=1)(Collector)
actors = [Actor.remote(make, seed=1, number=number) for number in range(PROCESSES)]
policy = GaussianPolicy.new(inputs=4, outputs=2, log_std=-1.0, seed=1)
rollouts: list[Any] = []
for iteration in range(3):
    shared = ray.put(policy)  # sent to each machine once
    rollouts = ray.get([actor.collect.remote(shared, steps=64) for actor in actors])
    rewards = np.concatenate([rollout.ends.rewards for rollout in rollouts])
    print(f"iteration {iteration}: {len(rewards)} episodes ended, mean {rewards.mean():.1f}")
    # policy = what your learner makes of policy and rollouts
ray.get([actor.close.remote() for actor in actors])
ray.shutdown()

with Collector(make, seed=1, number=1) as alone:
    again = [alone.collect(policy, steps=64) for _ in range(3)][-1]
same = again.observations.tobytes() == rollouts[1].observations.tobytes()
print(f"collected in this process, the same to the last bit: {same}")
