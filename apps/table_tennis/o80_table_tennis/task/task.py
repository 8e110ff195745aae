"""The protocol of a task, the part of an environment that can be exchanged.

The environment moves arm and ball; the task defines observation, reward and end of an episode.
Every method takes the `State` of N episodes, and returns as many results: a single environment asks
for one episode, a vector environment for many. `ball_play` has examples.
"""

from __future__ import annotations

from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from o80.base.arrays import Float32Array, FloatArray

from .state import State


@runtime_checkable
class Task(Protocol):
    """Give an object with these members as `TaskSettings(task=...)`."""

    @property
    def low(self) -> Float32Array:
        """(M,) least observation; the environment clips into the box."""
        ...

    @property
    def high(self) -> Float32Array:
        """(M,) largest observation."""
        ...

    def begin(self, rng: np.random.Generator) -> FloatArray:
        """The goal (G,) of a new episode, as `State.goal` has it; draw from `rng` only."""
        ...

    def observe(self, state: State) -> FloatArray:
        """Observations (..., M), fresh arrays."""
        ...

    def eventful(self, state: State) -> Any:
        """(...) whether the episode may have ended, or the step is paid.

        Asked after every step, so it should be cheap; `end` and `reward` are asked only where it is
        true. Elsewhere the episode goes on, and the step is worth 0.
        """
        ...

    def end(self, state: State) -> NDArray[np.int64]:
        """(...) numbers of `End`: RUNNING, or why the episode ended."""
        ...

    def reward(self, state: State) -> FloatArray:
        """(...) rewards of the last step."""
        ...

    def info(self, state: State) -> dict[str, Any]:
        """Further entries of `info`, each (...)."""
        ...


def missing_members(task: object) -> list[str]:
    """The members that an object lacks to be a task."""
    members = [name for name in vars(Task) if not name.startswith("_")]
    return [name for name in members if not hasattr(task, name)]
