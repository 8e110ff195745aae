"""The workers that collect the rollouts of a training: this process, or actors of Ray."""

from __future__ import annotations

from functools import partial

from o80.learning.rollouts import LocalWorkers, RayWorkers, Workers

from .copies import Stopwatch, training_copies
from .settings import LearningSettings

INFOS = ("touched", "returned")
"""Entries of an episode's last info that a training counts."""


def training_workers(settings: LearningSettings, watch: Stopwatch) -> Workers:
    """Each has an equal share of the environments; `watch` is told of those of this process."""
    count = max(1, settings.actors)
    make = partial(
        training_copies,
        settings.conditions,
        count=settings.ppo.environments // count,
        ball_seed=settings.seed,
    )
    if settings.actors:
        return RayWorkers(make, workers=count, seed=settings.seed, infos=INFOS)
    return LocalWorkers(partial(make, watch=watch), workers=count, seed=settings.seed, infos=INFOS)
