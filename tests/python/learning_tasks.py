"""Tasks for the tests of o80.learning, which use every part of it."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from gymnasium import spaces
from gymnasium.spaces import Box

import o80
from o80.learning import GroupTask, Index, Outcome, VectorEnvironment

COPIES, INFOS = 5, ("apart", "why")
"""Number of the copies that collectors step, and their infos."""


class Reach(GroupTask):
    """Two joints reach a random goal; noisy observations, flags, all kinds of infos, pictures."""

    metadata = {"render_modes": ["rgb_array"], "render_fps": 50}  # noqa: RUF012

    def __init__(
        self,
        copies: int = 1,
        threads: int | None = None,
        max_steps: int = 9,
        *,
        joined: bool = False,
    ) -> None:
        group = o80.robots.load("two_joints").inline(copies=copies, threads=threads, gain=60.0)
        super().__init__(
            group,
            burst=group.prepared_burst(6, steps=2, each=3),
            seen=group.gather(
                [o80.Gathered("observed", scale=0.5), "extended.effort"],
                {"far": ("observed.elbow", ">", 0.3), "left": ("observed.shoulder", "<", -0.4)},
            ),
            observation_space=Box(-9, 9, (6,), np.float32),
            action_space=Box(-1, 1, (4,), np.float32),
            max_steps=max_steps,
            reset=group.prepared_request("reset", seed=3) if joined else None,
        )
        self.goals = np.zeros((copies, 2))
        self.generators: list[Any] = [None] * copies

    def begin(
        self,
        copies: Any,
        generators: Sequence[np.random.Generator],
        options: Mapping[str, Any],
    ) -> None:
        for copy, generator in zip(copies.tolist(), generators, strict=True):
            self.generators[copy] = generator
            self.goals[copy] = options.get("goal", generator.uniform(-1, 1, 2))
        if self.reset is None:
            self.group.request("reset", copies=copies, seed=[3] * len(copies))

    def observe(self, copies: Index) -> Any:
        seen = self.seen.observations[copies]
        noise = [each.normal(0, 0.01, 2) for each in np.array(self.generators)[copies]]
        return np.hstack([seen, self.goals[copies] + noise])

    def judge(self, copies: Any) -> Outcome:
        apart = np.abs(self.seen.observations[copies, :2] - self.goals[copies]).sum(axis=1)
        return Outcome(
            reward=-apart,
            terminated=self.seen["far"][copies],
            truncated=self.seen["left"][copies] & ~self.seen["far"][copies],
            info={"apart": apart, "why": np.where(self.seen["far"][copies], "far", "left")},
        )

    def info(self, copies: Index) -> Mapping[str, Any]:
        return {
            "steps": self.steps[copies],
            "close": np.abs(self.goals[copies]).max(axis=1) < 0.5,
            "goal": {"place": self.goals[copies], "first": self.goals[copies, 0]},
            "word": np.where(self.steps[copies] % 2, "odd", "even"),
            "small": self.goals[copies, 1].astype(np.float32),
        }

    def render(self, copy: int) -> Any:
        return np.full((2, 3, 3), self.steps[copy], np.uint8)


class Joined(Reach):
    """Reach whose episodes begin in the call of the burst of the other copies."""

    def __init__(self, copies: int = 1, threads: int | None = None) -> None:
        super().__init__(copies, threads, max_steps=6, joined=True)


class Goal(Reach):
    """Reach with a dict of observations, discrete actions and no flags."""

    def __init__(self, copies: int = 1, threads: int | None = None) -> None:
        super().__init__(copies, threads, max_steps=5)
        self.observation_space = spaces.Dict(
            {"seen": Box(-9, 9, (4,), np.float32), "goal": Box(-9, 9, (2,), np.float64)}
        )
        self.action_space = spaces.Discrete(3)

    def targets(self, actions: Any) -> Any:
        return np.broadcast_to(0.4 * (actions - 1.0)[:, None, None], (len(actions), 2, 2))

    def flagged(self) -> Any:
        return np.ones(self.copies, np.bool_)

    def observe(self, copies: Index) -> Any:
        return {"seen": self.seen.observations[copies], "goal": self.goals[copies]}


def reaching(task: type[Reach] = Reach) -> VectorEnvironment:
    """Makes copies for a collector."""
    return VectorEnvironment(task(COPIES, threads=1), autoreset_mode="SameStep")
