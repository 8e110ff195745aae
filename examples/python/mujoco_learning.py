"""A learning task on a MuJoCo model: sixty-four carts search for gains that balance a pole."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium.spaces import Box

import o80
from o80.learning import GroupTask, Outcome, VectorEnvironment

MODEL = Path(__file__).parent / "models" / "cart_pole.xml"
CART, POLE = "extended.joints[0].position", "extended.joints[1].position"


class Balance(GroupTask):
    """Keep the pole within 0.2 rad and the cart within 0.8 m, after a random push."""

    def __init__(self, copies: int) -> None:
        group = o80.robots.load("mujoco").inline(copies=copies, model=MODEL, mode="control")
        super().__init__(
            group,
            burst=group.prepared_burst(5),
            seen=group.gather(
                [CART, POLE, "extended.joints[0].velocity", "extended.joints[1].velocity"],
                {
                    "a": (CART, ">", 0.8),
                    "b": (CART, "<", -0.8),
                    "c": (POLE, ">", 0.2),
                    "d": (POLE, "<", -0.2),
                },
            ),
            observation_space=Box(-np.inf, np.inf, (4,), np.float32),
            action_space=Box(-20, 20, (1,), np.float32),
            max_steps=200,
        )

    def begin(self, copies: Any, generators: Sequence[np.random.Generator], options: Any) -> None:
        self.group.request("reset", copies=copies)
        self.burst.targets[copies, 0, 0] = [each.uniform(-5, 5) for each in generators]
        self.burst.run(copies)

    def judge(self, copies: Any) -> Outcome:  # of the flag only, or of the end
        return Outcome(terminated=self.seen.flags[copies].any(axis=1))


random = np.random.default_rng(1)
mean, spread = np.zeros(4), np.full(4, 40.0)
with VectorEnvironment(Balance(64)) as environments:
    for generation in range(8):
        gains = random.normal(mean, spread, (64, 4))
        observations, infos = environments.reset(seed=generation)
        stood = np.zeros(64)  # steps of the first episode of each copy
        standing = np.ones(64, bool)
        for _step in range(200):
            actions = (gains * observations).sum(axis=1, keepdims=True)
            observations, rewards, terminated, truncated, infos = environments.step(actions)
            standing &= ~terminated
            stood += standing
        best = gains[np.argsort(stood)[-8:]]
        mean, spread = best.mean(axis=0), best.std(axis=0) + 1.0
        print(f"generation {generation}: stood {stood.mean() * 0.01:.2f} s")
