"""The environments of a training, as Stable-Baselines3 wants them."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecEnv
from stable_baselines3.common.vec_env.base_vec_env import VecEnvObs, VecEnvStepReturn, VecEnvWrapper

import o80

from ..players.conditions import Conditions
from ..task.full_observation import full_observation
from .copies import training_copies

Float32Array = NDArray[np.float32]

BALL_PARTS = (
    *("ball_position", "ball_velocity", "spin"),
    *("crossing_position", "crossing_velocity", "crossing_time"),
)
"""Parts of the full observation that tell of the ball; the others tell of the arm and the time."""


def visible_numbers(conditions: Conditions, size: int, *, blind: bool) -> Float32Array:
    """(M,) 1 for the numbers of an observation that a policy sees; a blind one sees no ball.

    Raises ValueError for a blind policy without a clock.
    """
    visible = np.ones(size, np.float32)
    if blind:
        full = full_observation(conditions.observation)
        if full is None:
            raise ValueError(
                "a blind policy needs the time, which the published observation does not hold: "
                "give observation='full'"
            )
        for part in BALL_PARTS:
            visible[full.places()[part]] = 0.0
    return visible


class Masked(VecEnvWrapper):
    """Environments with some numbers of their observations set to 0."""

    def __init__(self, environments: VecEnv, visible: Float32Array) -> None:
        super().__init__(environments)
        self._visible = visible

    def reset(self) -> VecEnvObs:
        """The first observations."""
        return self._masked(self.venv.reset())

    def step_wait(self) -> VecEnvStepReturn:
        """The outcome of the step under way."""
        observations, rewards, dones, infos = self.venv.step_wait()
        for copy in np.flatnonzero(dones):
            infos[copy]["terminal_observation"] = self._masked(infos[copy]["terminal_observation"])
        return self._masked(observations), rewards, dones, infos

    def _masked(self, observations: Any) -> Float32Array:
        masked: Float32Array = observations * self._visible
        return masked


class Timed(VecEnvWrapper):
    """Environments that count the processor time spent in them."""

    seconds = 0.0

    def reset(self) -> VecEnvObs:
        """The first observations."""
        begun = time.process_time()
        observations = self.venv.reset()
        self.seconds += time.process_time() - begun
        return observations

    def step_wait(self) -> VecEnvStepReturn:
        """The outcome of the step under way, which is carried out here."""
        begun = time.process_time()
        outcome = self.venv.step_wait()
        self.seconds += time.process_time() - begun
        return outcome


def opened(conditions: Conditions, *, count: int, seed: int, ball_seed: int) -> VecEnv:
    """Environments that play the shots of `ball_seed`; copy i is seeded with seed + i."""
    copies = training_copies(conditions, count=count, ball_seed=ball_seed)
    environments: VecEnv = o80.learning.stable_baselines3(copies, infos="ends")
    environments.seed(seed)
    return environments


def generators_of(environments: VecEnv) -> list[np.random.Generator]:
    """The random generators of the environments, from which every episode draws."""
    return list(environments.get_attr("np_random", 0)[0])
