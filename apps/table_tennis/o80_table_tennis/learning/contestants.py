"""Policies by their names, each with the conditions that it plays in."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

from ..players.conditions import Conditions
from ..players.learned_policy import SHIPPED, LearnedPolicy
from ..players.policies import DEFAULT_FACTOR, Policy, RandomPolicy, StillPolicy, default_policy
from ..rig.arm_numbers import ArmNumbers

Contestant = tuple[Policy, Conditions]


def _scripted() -> Contestant:
    conditions = Conditions(factor=DEFAULT_FACTOR, repeat=1, observation="published")
    return default_policy(), conditions


def _scripted_chunks() -> Contestant:
    policy, conditions = _scripted()
    return policy, replace(conditions, chunk_size=10, action_steps=5, delay=16)


def _learned() -> Contestant:
    policy = LearnedPolicy.load(SHIPPED)
    return policy, policy.conditions


NAMED: Mapping[str, Callable[[], Contestant]] = {
    "still": lambda: (StillPolicy(), Conditions()),
    "random": lambda: (RandomPolicy(), Conditions()),
    "scripted": _scripted,
    "scripted_chunks": _scripted_chunks,
    "learned": _learned,
}


def contestant(name: str, *, balls: str | None = None, preset: str | None = None) -> Contestant:
    """The policy of a name, or that of a file; it plays in its own conditions, but for what is
    given. Raises ValueError or FileNotFoundError.
    """
    if name in NAMED:
        policy, conditions = NAMED[name]()
    elif Path(name).with_suffix(".npz").is_file():
        policy = LearnedPolicy.load(Path(name))
        conditions = policy.conditions
    else:
        raise FileNotFoundError(
            f"unknown policy '{name}': give {', '.join(NAMED)}, or the file of a learned one "
            "(policy.npz)"
        )
    conditions = conditions.playing(balls)
    if preset is not None:
        conditions = replace(conditions, preset=preset)
    if name.startswith("scripted"):
        policy = default_policy(ArmNumbers.of_rig(conditions.rig()), conditions.task())
    return policy, conditions
