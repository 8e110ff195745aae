"""The copies that a training steps; light, because actors on other machines import it."""

from __future__ import annotations

from dataclasses import replace

from gymnasium.vector import AutoresetMode

from o80.learning import VectorEnvironment

from ..entry_points import vector_environment
from ..players.conditions import Conditions

HISTORY = 64
"""Rows that arms and twins keep: few, as nobody looks back."""


def training_copies(conditions: Conditions, *, count: int, ball_seed: int) -> VectorEnvironment:
    """Copies that play the shots of `ball_seed`, on one thread."""
    return vector_environment(
        num_envs=count,
        rig=replace(conditions.rig(), history=HISTORY),
        task=conditions.task(ball_seed=ball_seed),
        threads=1,
        autoreset_mode=AutoresetMode.SAME_STEP,
    )
