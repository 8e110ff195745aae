"""Environments and policies for the tests of rollouts."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from learning_tasks import Reach
from vector_equality import assert_same

from o80.learning import Outcome, VectorEnvironment
from o80.learning.rollouts import GaussianPolicy, Make, Rollout
from o80.learning.rollouts.rollout import arrays_of

COPIES = 5
INFOS = ("apart", "why")


class Failing(Reach):
    """Raises once, in the third step after a file was created."""

    def __init__(self, copies: int, folder: Path) -> None:
        super().__init__(copies, threads=1)
        self._folder, self._steps = folder, 0

    def judge(self, copies: Any) -> Outcome:
        if any(self._folder.iterdir()):
            self._steps += 1
        if self._steps == 3:
            self._steps = 0
            (self._folder / "raise").unlink()
            raise ArithmeticError("the ball is square")
        return super().judge(copies)


def opened(folder: Path) -> VectorEnvironment:
    return VectorEnvironment(Failing(COPIES, folder), autoreset_mode="SameStep")


def maker(folder: Path) -> Make:
    return partial(opened, folder)


def policies(count: int) -> Sequence[GaussianPolicy]:
    """Creates policies with a small network and random numbers."""
    first = GaussianPolicy.new(6, 4, hidden=(32, 16), log_std=-0.7, seed=4)
    random = np.random.default_rng(8)
    return [
        replace(
            first,
            mean=random.normal(0, 0.1, 6).astype(np.float32),
            scale=random.uniform(0.5, 2, 6).astype(np.float32),
            weights=tuple(
                random.normal(0, 0.3, weight.shape).astype(np.float32) for weight in first.weights
            ),
        )
        for _ in range(count)
    ]


def assert_same_rollouts(some: Sequence[Rollout], others: Sequence[Rollout]) -> None:
    """Compares numbers, types and shapes, bit for bit."""
    for place, (one, other) in enumerate(zip(some, others, strict=True)):
        assert_same(dict(arrays_of(one)), dict(arrays_of(other)), f"rollout {place}")
