"""The environment of the lab, on the arm and the world that run, and who plays in it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

import o80

from ..environment import TableTennisEnvironment
from ..players.conditions import Conditions
from ..players.learned_policy import LearnedPolicy, shipped_policy
from ..players.policies import DEFAULT_FACTOR, Policy, default_policy
from ..rig.arm_numbers import ArmNumbers
from ..rig.rig import arm_options
from ..settings import Pacing, TaskSettings
from .parts import ARM, WORLD, LabSettings

Home = tuple[NDArray[np.float64], NDArray[np.float64]]
"""Pressures (8,) and angles (4,) of the arm at its start."""


def policy_of(settings: LabSettings) -> Policy:
    """Who plays."""
    if settings.policy == "learned":
        return shipped_policy()
    return default_policy(ArmNumbers.of_rig(settings.rig))


def opened(settings: LabSettings, policy: Policy, home: Home) -> TableTennisEnvironment:
    """The environment of a policy, attached to arm and world. Raises o80.Error."""
    rig = replace(
        settings.rig,
        pacing=Pacing.REAL_TIME,
        attach=True,
        arm_segment=settings.segment(ARM),
        twin_segment=settings.segment(WORLD),
    )
    environment = TableTennisEnvironment(rig=rig, task=task_of(settings, policy))
    start = environment.task.home_of_arm  # the arm may stand anywhere now
    start.pressures, start.angles = home
    return environment


def home_of(settings: LabSettings) -> Home:
    """Where the arm starts: a copy of it tells."""
    with o80.robots.load("pam").inline(**arm_options(settings.rig)) as arm:
        row = arm.latest()
        return np.array(row.desired), np.array(row.extended.joint_positions)


def task_of(settings: LabSettings, policy: Policy) -> TaskSettings:
    """Task of the policy, with its own actions and observation."""
    if isinstance(policy, LearnedPolicy):
        conditions: Conditions = policy.conditions
        return conditions.task(fly_out=False)  # its noise sets the filter of the observer
    return TaskSettings(factor=DEFAULT_FACTOR)
