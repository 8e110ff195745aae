"""The arm and its mirroring worlds, as a rig of o80.hybrid."""

from __future__ import annotations

from typing import Any

import numpy as np

import o80
from o80.hybrid import Mirror, Rig, attach

from ..settings import RigSettings
from ..world.arm import JOINT_NAMES, MUSCLES, PLAYING_POSTURE
from ..world.scene import MODEL
from ..world.timing import ITERATIONS
from .ball_records import ball_options

MOTION = ("extended.joint_positions", "extended.joint_velocities")
"""Adjacent fields of a row: angles [rad] and velocities [rad/s] of the joints."""
LANE_BLOCKS = 2048
"""Size of a copied world's lane [64 bytes]: a recorded flight is sent in one batch."""


def arm_options(settings: RigSettings) -> dict[str, Any]:
    """Returns the options of the pneumatic arm."""
    return {
        "preset": settings.preset,
        "muscle": settings.muscle,
        "ranges": settings.ranges,
        "start_noise": settings.start_noise,
        "start_posture": PLAYING_POSTURE,
        "period": settings.period,
    }


def world_options(settings: RigSettings) -> dict[str, Any]:
    """Returns the options of the simulation of arm, table and ball."""
    return {"model": str(MODEL), "timestep": settings.period, **ball_options()}


def rig_of(settings: RigSettings, *, delay: int, group: bool) -> Rig:
    """Makes the rig of these settings. group: for copies, or several worlds.

    Raises ValueError if the running robot is another arm.
    """
    arm, world = arm_options(settings), world_options(settings)
    if settings.history is not None:
        arm["history"] = world["history"] = settings.history
    if settings.attach:
        _check_arm(settings)
    elif settings.arm_segment is not None:
        arm["segment"] = settings.arm_segment
    if group:
        world["lane_blocks"] = LANE_BLOCKS
    return Rig(
        robot="pam",
        robot_options=arm,
        world="mujoco" if settings.twin_segment is None else attach(settings.twin_segment),
        world_options=world,
        mirror=Mirror(*MOTION, JOINT_NAMES),
        every=ITERATIONS,
        delay=delay,
        worlds=settings.worlds,
        frequency=settings.frequency,
    )


def _check_arm(settings: RigSettings) -> None:
    """Raises ValueError if the running robot is not the arm of these settings."""
    segment = str(settings.arm_segment)
    with o80.Frontend(segment) as frontend:
        actuators, period = len(frontend.actuators), frontend.period
    if actuators != MUSCLES:
        raise ValueError(
            f"segment '{segment}' is not a pneumatic arm: it has {actuators} actuators, not "
            f"{MUSCLES} muscles. Start an arm with `o80 run pam` and give the name of its segment: "
            "arm_segment"
        )
    if not np.isclose(period, settings.period):
        frequency = 1.0 / period
        raise ValueError(
            f"the arm '{segment}' runs at {frequency:g} Hz, the rig at {settings.frequency:g} Hz: "
            f"give RigSettings(frequency={frequency:g}), or restart the arm"
        )
