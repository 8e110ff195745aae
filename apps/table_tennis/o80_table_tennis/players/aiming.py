"""How a ball must leave the racket to land on a target."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..physics.aerodynamics import Aerodynamics, State, runge_kutta_step
from ..world.scene import Vector

FloatArray = NDArray[np.float64]


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
    dt = duration / steps
    turn = (
        aerodynamics.magnus * spin[0],
        aerodynamics.magnus * spin[1],
        aerodynamics.magnus * spin[2],
    )
    halved_at = aerodynamics.halved_at(math.hypot(*(float(value) for value in spin)))
    # start with a flight without air, then add the miss that the air causes
    velocity = (target - position) / duration
    velocity[2] += 0.5 * aerodynamics.gravity * duration
    for _ in range(corrections):
        state: State[float] = (*position.tolist(), *velocity.tolist())
        for _ in range(steps):
            state = runge_kutta_step(
                state, turn, aerodynamics.drag, aerodynamics.gravity, dt, halved_at
            )
        velocity = velocity + (target - np.array(state[:3])) / duration
    return velocity
