"""Evaluations during a training: the deterministic policy on balls that it is not trained with."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import o80
from o80.base.arrays import Float32Array

from ..players.conditions import Conditions
from .copies import training_copies
from .episodes import EpisodeCounter, EpisodeOutcome, Shares, shares

BALL_SEED = 900_001
"""Seed of the shots of validation, which no training and no verdict plays."""
ENVIRONMENTS = 20


class Validation:
    """Plays the same shots, in the same noise, whenever it is asked. Close it."""

    def __init__(self, conditions: Conditions, balls: int, seed: int = BALL_SEED) -> None:
        count = min(ENVIRONMENTS, balls)
        copies = training_copies(conditions, count=count, ball_seed=seed)
        self._environments = o80.learning.stable_baselines3(copies, infos="ends")
        self._each, self._seed = -(-balls // count), seed

    def play(self, act: Callable[[Float32Array], Float32Array]) -> Shares:
        """Plays the balls, as many in each environment, and returns the shares.

        act: the policy, observations (N, M) => actions (N, 8).
        """
        environments = self._environments
        environments.seed(self._seed)
        counter = EpisodeCounter(environments.num_envs)
        played: list[list[EpisodeOutcome]] = [[] for _ in range(environments.num_envs)]
        observations: Any = environments.reset()
        while any(len(each) < self._each for each in played):
            observations, rewards, dones, infos = environments.step(act(observations))
            for copy, outcome in counter.step(rewards, dones, infos):
                played[copy].append(outcome)
        return shares([outcome for each in played for outcome in each[: self._each]])

    def close(self) -> None:
        """Ends the environments."""
        self._environments.close()
