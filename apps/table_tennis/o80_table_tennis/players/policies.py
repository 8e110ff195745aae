"""Policies turn observations into actions: the protocol, baselines, the default policy."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from o80.base.arrays import Float32Array

from ..rig.arm_numbers import ArmNumbers
from ..settings import TaskSettings
from ..task.actions import COARSE, FINE
from ..task.observations import BALL_POSITION, BALL_VELOCITY, JOINT_POSITIONS
from ..world.arm import MUSCLES
from .found_parameters import found_settings
from .hitting_policy import HittingPolicy
from .rolled_out_policy import RolledOutPolicy

DEFAULT_FACTOR = COARSE
"""Factor of the environment's actions for which `default_policy` is made."""


class Policy(Protocol):
    """Chooses actions from observations only."""

    def reset(self) -> None:
        """A new episode begins."""
        ...

    def act(self, observation: Float32Array) -> NDArray[np.float32]:
        """The action (8,) in [-1, 1], or chunk (n, 8), after `observation` (22,)."""
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
        """Uniform in [-1, 1]."""
        return self._rng.uniform(-1.0, 1.0, MUSCLES).astype(np.float32)


@dataclass
class SweepPolicy:
    """Swings the first joint when the ball comes near: a baseline that sees time, not height."""

    lead: float = 0.2
    """How long before the ball passes the arm the swing begins [s]."""
    direction: float = 1.0
    """Which way joint 1 swings."""

    def reset(self) -> None:
        """Every action follows from one observation."""

    def act(self, observation: Float32Array) -> NDArray[np.float32]:
        """More pressure in one muscle of joint 1, less in the other, while the swing lasts."""
        action = np.zeros(MUSCLES, dtype=np.float32)
        y, vy = observation[BALL_POSITION][1], observation[BALL_VELOCITY][1]
        swinging = vy < 0 and y < -vy * self.lead and abs(observation[JOINT_POSITIONS][0]) < 1.2
        if swinging:
            action[0], action[1] = self.direction, -self.direction
        return action


BASELINES: Mapping[str, tuple[Callable[[], Policy], float]] = {
    "still arm": (StillPolicy, FINE),
    "random, fine": (RandomPolicy, FINE),
    "random, coarse": (RandomPolicy, COARSE),
}
"""Baselines that a policy must beat, and the factors of their actions; each plays the same in every
run."""


def default_policy(arm: ArmNumbers | None = None, task: TaskSettings | None = None) -> Policy:
    """The best policy there is for an arm; None: the standard one. It answers with action chunks
    if the task has them.

    `ArmNumbers.of(frontend)` reads those of an arm that runs, `ArmNumbers.of_rig(settings)` those
    of an arm to come.
    """
    settings = found_settings() if arm is None else found_settings().for_arm(arm)
    if task is None or task.chunk_size is None:
        return HittingPolicy(settings)
    return RolledOutPolicy(settings, task)
