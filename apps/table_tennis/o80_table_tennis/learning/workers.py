"""The workers that collect the rollouts of a training: this process, or actors of Ray."""

from __future__ import annotations

from functools import partial

from o80.learning.rollouts import LocalWorkers, RayWorkers, Workers

from .copies import Stopwatch, timed_copies, training_copies
from .settings import LearningSettings

INFOS = ("touched", "returned")
"""Entries of an episode's last info that a training counts."""


def training_workers(settings: LearningSettings, watch: Stopwatch) -> Workers:
    """Each has an equal share of the environments; `watch` is told of those of this process."""
    workers = max(1, settings.actors)
    count, ball_seed = settings.ppo.environments // workers, settings.seed
    if settings.actors:
        make = partial(training_copies, settings.conditions, count=count, ball_seed=ball_seed)
        return RayWorkers(make, workers=workers, seed=settings.seed, infos=INFOS)
    timed = partial(
        timed_copies, settings.conditions, count=count, ball_seed=ball_seed, watch=watch
    )
    return LocalWorkers(timed, workers=workers, seed=settings.seed, infos=INFOS)
