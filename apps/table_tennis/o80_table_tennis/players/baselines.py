"""Baselines that a policy must beat: an arm that does nothing, and one that does anything."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from ..task.actions import COARSE, FINE
from .policies import Policy, RandomPolicy, StillPolicy


@dataclass(frozen=True)
class Baseline:
    """A policy without knowledge, and the factor of its actions."""

    made: Callable[[], Policy]
    factor: float


BASELINES: Mapping[str, Baseline] = {
    "still arm": Baseline(StillPolicy, FINE),
    "random, fine": Baseline(RandomPolicy, FINE),
    "random, coarse": Baseline(RandomPolicy, COARSE),
}
"""By name; each plays the same in every run."""
