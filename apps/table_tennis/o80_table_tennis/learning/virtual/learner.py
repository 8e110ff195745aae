"""Stable-Baselines3's SAC, fed with motions instead of an environment."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import torch
from gymnasium import spaces
from stable_baselines3.common.logger import Logger

from o80.base.arrays import Float32Array

from ...world.arm import MUSCLES
from .buffer import MotionBuffer
from .fast_sac import FastSac
from .hindsight import Transitions
from .motions import Motion
from .settings import SacSettings

CLIP = 10.0
"""Scaled observations lie within plus or minus this."""
MIN_SPREAD = 1e-3
"""Smallest spread by which a number of an observation is divided: some hardly change."""


class Learner:
    """A policy and what it has learned from. The same seed gives the same one.

    Observations are scaled by mean and spread of the first motions, and never anew: what is stored
    stays valid.
    """

    def __init__(self, settings: SacSettings, first: list[Motion], *, seed: int) -> None:
        seen = np.concatenate([motion.observations[:, 0] for motion in first])
        self._mean = seen.mean(axis=0)
        self._scale = 1.0 / np.maximum(seen.std(axis=0), MIN_SPREAD)
        box = spaces.Box(-CLIP, CLIP, self._mean.shape, np.float32)
        self._settings = settings
        self._sac = FastSac(
            "MlpPolicy",
            _Spaces(box),
            buffer_size=1,
            batch_size=settings.batch,
            learning_rate=settings.learning_rate,
            gamma=settings.discount,
            tau=settings.target_rate,
            ent_coef=settings.entropy,
            policy_kwargs={
                "net_arch": [settings.hidden, settings.hidden],
                "optimizer_kwargs": {"fused": True},
            },
            seed=seed,
            device="cpu",
        )
        self._sac.set_logger(Logger(None, []))  # `configure` would leave a folder in /tmp
        self.buffer = MotionBuffer(settings.buffer, box, self._sac.action_space)
        self._sac.replay_buffer = self.buffer

    def scaled(self, observations: Float32Array) -> Float32Array:
        """Observations (..., M) as the networks see them."""
        scaled = (observations - self._mean) * self._scale
        result: Float32Array = np.clip(scaled, -CLIP, CLIP).astype(np.float32)
        return result

    def remember(self, new: Transitions) -> None:
        """Keeps them to learn from."""
        self.buffer.extend(
            Transitions(
                self.scaled(new.observations),
                new.actions,
                new.rewards,
                self.scaled(new.next_observations),
                new.terminated,
            )
        )

    def learn(self, gradient_steps: int) -> None:
        """From what is kept."""
        self._sac.train(gradient_steps, self._settings.batch)

    def explore(self, observation: Float32Array) -> Float32Array:
        """An action (8,), drawn."""
        return self._act(observation, deterministic=False)

    def act(self, observations: Float32Array) -> Float32Array:
        """The most likely actions (..., 8) after observations (..., M)."""
        return self._act(observations, deterministic=True)

    def _act(self, observations: Float32Array, *, deterministic: bool) -> Float32Array:
        with torch.no_grad():
            seen = torch.from_numpy(self.scaled(observations)).reshape(-1, len(self._mean))
            actions = self._sac.actor(seen, deterministic=deterministic).numpy()
        result: Float32Array = actions.reshape(*observations.shape[:-1], MUSCLES)
        return result


class _Spaces(gymnasium.Env[Float32Array, Float32Array]):
    """SAC wants an environment for its spaces; it never steps this one."""

    def __init__(self, box: Any) -> None:
        self.observation_space: spaces.Space[Float32Array] = box
        self.action_space: spaces.Space[Float32Array] = spaces.Box(
            -1.0, 1.0, (MUSCLES,), np.float32
        )

    def reset(self, **_: Any) -> tuple[Float32Array, dict[str, Any]]:
        """Nothing is seen."""
        return np.zeros(self.observation_space.shape or (), np.float32), {}
