"""How a ball must leave the racket to land on a target."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from o80.base.arrays import FloatArray
from o80_mujoco.balls import path

from ..physics.aerodynamics import Aerodynamics
from ..world.scene import Vector


def velocity_to_land(
    position: FloatArray,
    target: FloatArray,
    duration: float,
    *,
    spin: Vector | FloatArray,
    aerodynamics: Aerodynamics,
    steps: int = 6,
    corrections: int = 2,
) -> FloatArray:
    """The velocity (3,) with which a ball flies from `position` to `target` (3,) in `duration` [s].

    Its `spin` (3,) [rad/s] is taken as constant.
    """
    air = replace(aerodynamics, spin_decay=0.0).air
    # start with a flight without air, then add the miss that the air causes
    velocity = (target - position) / duration
    velocity[2] += 0.5 * aerodynamics.gravity * duration
    for _ in range(corrections):
        ball = np.concatenate([position, velocity, spin])[np.newaxis]
        landing = path(ball, duration / steps, steps, air)[-1, 0, :3]
        velocity = velocity + (target - landing) / duration
    return velocity
