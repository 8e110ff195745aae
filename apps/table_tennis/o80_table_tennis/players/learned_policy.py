"""A learned policy, as `python -m o80.learning train` writes it, and what it plays in."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

from o80.base.arrays import Float32Array
from o80.learning.training import policy

from .conditions import Conditions

SHIPPED = Path(__file__).with_name("learned")
"""The policy that comes with this package, `learned.npz` and `learned.json`."""
TASK = "o80_table_tennis.learning:play"
"""The task that policies are trained for."""


@dataclass
class LearnedPolicy:
    """Plays in an environment of `conditions`: `conditions.rig()` and `conditions.task()`."""

    learned: policy.LearnedPolicy
    conditions: Conditions

    def reset(self) -> None:
        """Every action follows from one observation."""

    def act(self, observation: Float32Array) -> Float32Array:
        """The action (..., 8) after observations (..., M)."""
        return self.learned.act(observation)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> LearnedPolicy:
        """Loads both files; `path` names one of them, or the folder of a training.

        Raises o80.InvalidArgument or ValueError.
        """
        learned = policy.LearnedPolicy.load(path)
        if learned.task.name != TASK:
            raise ValueError(f"{path} was trained for '{learned.task.name}', not for '{TASK}'")
        return cls(learned, Conditions.of_options(learned.task.options))


def shipped_policy() -> LearnedPolicy:
    """The policy that comes with this package."""
    return LearnedPolicy.load(SHIPPED)
