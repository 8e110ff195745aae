"""The deterministic policy on fresh shots, without virtual balls: copies of the environment."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np

from o80.base.arrays import Float32Array

from ...players.conditions import Conditions
from ...registration import ACCELERATED, register_environments
from ..episodes import EpisodeOutcome, Shares, shares

BALL_SEED = 800_001
"""Seed of the shots of evaluations, which no training plays."""
COPIES = 20


class Evaluation:
    """Plays the same shots whenever it is asked. Close it."""

    def __init__(self, conditions: Conditions, balls: int) -> None:
        register_environments()
        task = conditions.task(ball_seed=BALL_SEED)
        self._copies = min(COPIES, balls)
        self._each = -(-balls // self._copies)
        self._environment: Any = gymnasium.make_vec(
            ACCELERATED, num_envs=self._copies, rig=conditions.rig(), task=task, threads=1
        )

    def play(self, act: Callable[[Float32Array], Float32Array]) -> Shares:
        """Touched, returned and mean reward of a policy: observations (N, M) => actions (N, 8)."""
        environment = self._environment
        observations, _ = environment.reset(seed=BALL_SEED)
        played: list[list[EpisodeOutcome]] = [[] for _ in range(self._copies)]
        paid = np.zeros(self._copies)
        while any(len(each) < self._each for each in played):
            observations, rewards, ended, cut, info = environment.step(act(observations))
            paid += rewards
            for copy in np.flatnonzero(ended | cut):
                touched, returned = info["touched"][copy], info["returned"][copy]
                outcome = EpisodeOutcome(bool(touched), bool(returned), float(paid[copy]))
                played[copy].append(outcome)
                paid[copy] = 0.0
        return shares([outcome for each in played for outcome in each[: self._each]])

    def close(self) -> None:
        """Ends the copies."""
        self._environment.close()
