"""A training whose rollouts are collected by actors of Ray, on this machine or on others."""

from __future__ import annotations

from functools import partial

from o80.learning.rollouts import RayWorkers, Workers
from o80.learning.rollouts.ppo import WorkersEnv

from .copies import training_copies
from .settings import LearningSettings


def actor_environments(
    settings: LearningSettings, workers: type[Workers] = RayWorkers
) -> WorkersEnv:
    """The environments of a training, an equal share of them in each actor."""
    make = partial(
        training_copies,
        settings.conditions,
        count=settings.ppo.environments // settings.actors,
        ball_seed=settings.seed,
    )
    return WorkersEnv(
        workers(make, workers=settings.actors, seed=settings.seed, infos=("touched", "returned"))
    )
