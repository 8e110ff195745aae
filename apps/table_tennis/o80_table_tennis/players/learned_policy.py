"""A learned policy of `python -m o80.learning train`, with its conditions."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

from o80.base.arrays import Float32Array
from o80.learning.training import policy

from .conditions import Conditions

SHIPPED = Path(__file__).with_name("learned")
"""Path of the shipped policy, `learned.npz` and `learned.json`."""
TASK = "o80_table_tennis.learning:play"
"""Task for which policies are trained."""


@dataclass
class LearnedPolicy:
    """Learned policy for an environment with `conditions.rig()` and `conditions.task()`."""

    learned: policy.LearnedPolicy
    conditions: Conditions

    def reset(self) -> None:
        """Does nothing: each action depends on one observation only."""

    def act(self, observation: Float32Array) -> Float32Array:
        """Computes actions (..., 8) from observations (..., M)."""
        return self.learned.act(observation)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> LearnedPolicy:
        """Loads both files; `path` names one of them, or the folder of a training.

        Raises o80.InvalidArgument or ValueError for other files or another task.
        """
        learned = policy.LearnedPolicy.load(path)
        if learned.task.name != TASK:
            raise ValueError(f"{path} was trained for '{learned.task.name}', not for '{TASK}'")
        return cls(learned, Conditions.of_options(learned.task.options))


def shipped_policy() -> LearnedPolicy:
    """Loads the shipped policy."""
    return LearnedPolicy.load(SHIPPED)
