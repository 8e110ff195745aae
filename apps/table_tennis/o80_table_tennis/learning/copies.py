"""The copies that a training steps."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any

from gymnasium.vector import AutoresetMode, VectorEnv, VectorWrapper

from o80.learning import VectorEnvironment

from ..entry_points import vector_environment
from ..players.conditions import Conditions

HISTORY = 64
"""Rows that arms and twins keep: few, as nobody looks back."""


class Stopwatch:
    """Sums up processor time of this process."""

    seconds = 0.0

    def __enter__(self) -> None:
        self.seconds -= time.process_time()

    def __exit__(self, *_: object) -> None:
        self.seconds += time.process_time()


class Timed(VectorWrapper):
    """Environments whose steps and resets a stopwatch measures."""

    def __init__(self, environments: VectorEnv[Any, Any, Any], watch: Stopwatch) -> None:
        super().__init__(environments)
        self._watch = watch

    def reset(self, **options: Any) -> tuple[Any, dict[str, Any]]:
        """As that of the environments."""
        with self._watch:
            return self.env.reset(**options)

    def step(self, actions: Any) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """As that of the environments."""
        with self._watch:
            return self.env.step(actions)


def training_copies(conditions: Conditions, *, count: int, ball_seed: int) -> VectorEnvironment:
    """Copies that play the shots of `ball_seed`, on one thread."""
    return vector_environment(
        num_envs=count,
        rig=replace(conditions.rig(), history=HISTORY),
        task=conditions.task(ball_seed=ball_seed),
        threads=1,
        autoreset_mode=AutoresetMode.SAME_STEP,
    )
