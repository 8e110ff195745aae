"""Policies turn observations into actions: the protocol, baselines, the default policy."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from o80.base.arrays import Float32Array

from ..task.actions import COARSE, FINE
from ..world.arm import MUSCLES
from .hitting_policy import HittingPolicy, HittingSettings

DEFAULT_FACTOR = COARSE
"""Factor of the environment's actions for which `default_policy` is made."""


class Policy(Protocol):
    """Chooses actions from observations only."""

    def reset(self) -> None:
        """A new episode begins."""
        ...

    def act(self, observation: Float32Array) -> NDArray[np.float32]:
        """The action (8,) in [-1, 1], or chunk (n, 8), after `observation` (M,)."""
        ...


@dataclass
class StillPolicy:
    """Leaves the pressures as they are."""

    def reset(self) -> None:
        """Nothing to forget."""

    def act(self, observation: Float32Array) -> NDArray[np.float32]:
        """No change."""
        return np.zeros(MUSCLES, dtype=np.float32)


@dataclass
class RandomPolicy:
    """Draws each action at random, as an untrained learner does."""

    seed: int = 0

    def __post_init__(self) -> None:
        self._rng = np.random.default_rng(self.seed)

    def reset(self) -> None:
        """The draws go on: no episode repeats another."""

    def act(self, observation: Float32Array) -> NDArray[np.float32]:
        """Random action, uniform in [-1, 1]."""
        return self._rng.uniform(-1.0, 1.0, MUSCLES).astype(np.float32)


BASELINES: Mapping[str, tuple[Callable[[], Policy], float]] = {
    "still arm": (StillPolicy, FINE),
    "random, fine": (RandomPolicy, FINE),
    "random, coarse": (RandomPolicy, COARSE),
}
"""Baselines that a policy must beat, and the factors of their actions; each plays the same in every
run."""


def default_policy(settings: HittingSettings | None = None) -> Policy:
    """The scripted policy; None: for the standard arm.

    `HittingSettings.of(frontend)` are those for an arm that runs, `HittingSettings.of_rig(rig)`
    for an arm to come.
    """
    return HittingPolicy(settings)
