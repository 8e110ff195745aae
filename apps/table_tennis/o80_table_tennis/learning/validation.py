"""Evaluations during a training: the deterministic policy on balls that it is not trained with."""

from __future__ import annotations

from typing import Any

import o80

from ..players.network import Network
from .copies import training_copies
from .episodes import EpisodeCounter, EpisodeOutcome, Shares, shares
from .settings import LearningSettings

BALL_SEED = 900_001
"""Seed of the shots of validation, which no training and no verdict plays."""
ENVIRONMENTS = 20


class Validation:
    """Plays the same shots, in the same noise, whenever it is asked."""

    def __init__(self, settings: LearningSettings) -> None:
        count = min(ENVIRONMENTS, settings.evaluated)
        copies = training_copies(settings.conditions, count=count, ball_seed=BALL_SEED)
        self._environments = o80.learning.stable_baselines3(copies, infos="ends")
        self._each = -(-settings.evaluated // count)

    def play(self, network: Network) -> Shares:
        """Plays the balls with a network, as many in each environment, and returns the shares."""
        environments = self._environments
        environments.seed(BALL_SEED)
        counter = EpisodeCounter(environments.num_envs)
        played: list[list[EpisodeOutcome]] = [[] for _ in range(environments.num_envs)]
        observations: Any = environments.reset()
        while any(len(each) < self._each for each in played):
            actions = network.act(observations)
            observations, rewards, dones, infos = environments.step(actions)
            for copy, outcome in counter.step(rewards, dones, infos):
                played[copy].append(outcome)
        return shares([outcome for each in played for outcome in each[: self._each]])

    def close(self) -> None:
        """Ends the environments."""
        self._environments.close()
