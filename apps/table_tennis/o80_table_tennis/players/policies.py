"""Protocol of policies, baselines, and the default policy."""

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
"""Factor of the environment's actions for `default_policy`."""


class Policy(Protocol):
    """Maps observations to actions."""

    def reset(self) -> None:
        """Begins a new episode."""
        ...

    def act(self, observation: Float32Array) -> NDArray[np.float32]:
        """Returns the action (8,) in [-1, 1], or chunk (n, 8), after `observation` (M,)."""
        ...


@dataclass
class StillPolicy:
    """Keeps the pressures."""

    def reset(self) -> None:
        """Does nothing."""

    def act(self, observation: Float32Array) -> NDArray[np.float32]:
        """Returns zeros: no change."""
        return np.zeros(MUSCLES, dtype=np.float32)


@dataclass
class RandomPolicy:
    """Draws random actions, like an untrained learner."""

    seed: int = 0

    def __post_init__(self) -> None:
        self._rng = np.random.default_rng(self.seed)

    def reset(self) -> None:
        """Does nothing: the draws continue, so that no episode repeats another."""

    def act(self, observation: Float32Array) -> NDArray[np.float32]:
        """Returns a random action, uniform in [-1, 1]."""
        return self._rng.uniform(-1.0, 1.0, MUSCLES).astype(np.float32)


BASELINES: Mapping[str, tuple[Callable[[], Policy], float]] = {
    "still arm": (StillPolicy, FINE),
    "random, fine": (RandomPolicy, FINE),
    "random, coarse": (RandomPolicy, COARSE),
}
"""Baselines for comparisons, and the factors of their actions; each is the same in every
run."""


def default_policy(settings: HittingSettings | None = None) -> Policy:
    """Makes the scripted policy; None: for the standard arm.

    `HittingSettings.of(frontend)` gives the settings for a running arm,
    `HittingSettings.of_rig(rig)` for one to be started.
    """
    return HittingPolicy(settings)
