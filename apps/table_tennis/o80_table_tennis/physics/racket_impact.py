"""What the racket does to a ball, and how the ball must leave it to land on a target."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .aerodynamics import Aerodynamics, State, runge_kutta_step

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class RacketImpact:
    """Shares of the velocity relative to the racket that a ball keeps."""

    normal: float = 0.78
    """Along the face's normal; it turns round."""
    tangential: float = 0.78
    """Along the face."""

    def outgoing(self, ball: FloatArray, racket: FloatArray, normal: FloatArray) -> FloatArray:
        """Velocity of the ball afterwards, from those of ball and racket and the unit normal."""
        relative = ball - racket
        along = float(relative @ normal)
        kept: FloatArray = self.tangential * relative
        return racket + kept - (self.tangential + self.normal) * along * normal


def velocity_to_land(
    position: FloatArray,
    target: FloatArray,
    duration: float,
    *,
    spin: tuple[float, float, float],
    aerodynamics: Aerodynamics,
    steps: int = 6,
    corrections: int = 2,
) -> FloatArray:
    """With which a ball flies from `position` to `target` (3,) in `duration` [s].

    Its `spin` (3,) [rad/s] is taken as constant.
    """
    dt = duration / steps
    turn = (
        aerodynamics.magnus * spin[0],
        aerodynamics.magnus * spin[1],
        aerodynamics.magnus * spin[2],
    )
    # a flight without air, then what the air took off it is aimed further
    velocity = (target - position) / duration
    velocity[2] += 0.5 * aerodynamics.gravity * duration
    for _ in range(corrections):
        state: State[float] = (*position.tolist(), *velocity.tolist())
        for _ in range(steps):
            state = runge_kutta_step(state, turn, aerodynamics.drag, aerodynamics.gravity, dt)
        velocity = velocity + (target - np.array(state[:3])) / duration
    return velocity
