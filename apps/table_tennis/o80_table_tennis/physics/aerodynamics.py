"""Drag, Magnus force and gravity on a flying ball.

    a = -1/2 rho Cd A/m |v| v + 1/2 rho Cl A r/m / (1 + s r |omega| / |v|) (omega x v) - g z

rho is the density of air, A = pi r^2, m the mass. With s = 0 this is the law published for the
ball of the experiment; the saturation s is fitted to recorded shots with different spins.
The simulator implements the law in C++ (`o80_mujoco.balls`); this module has its numbers.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from o80_mujoco.balls import Air

from ..world.ball import BALL_MASS, BALL_RADIUS, GRAVITY


@dataclass(frozen=True)
class Aerodynamics:
    """Forces of air and gravity on the ball; also the options of the twins."""

    air_density: float = 1.18
    """[kg/m^3]"""
    drag_coefficient: float = 0.40
    """Cd: 0.34 to 0.44 in recorded shots without spin (published configuration: 0.47)."""
    lift_coefficient: float = 1.14
    """Cl of a slow spin: fitted with the bounces of recorded shots (published: 1.47, without
    saturation)."""
    lift_saturation: float = 3.0
    """s: the lift of a spin is halved where r |omega| / |v| is 1 / s. Fitted likewise."""
    spin_decay: float = 0.5
    """Share of the spin lost in a second [1/s]: the published 0.005 a step of 10 ms (with steps of
    2 ms, the spin of the recorded shots would decay five times too fast)."""
    gravity: float = GRAVITY
    """[m/s^2]"""
    radius: float = BALL_RADIUS
    """[m]"""
    mass: float = BALL_MASS
    """[kg]"""

    @property
    def drag(self) -> float:
        """1/2 rho Cd A/m [1/m]: the deceleration is drag * speed^2."""
        return self.drag_coefficient * self.drag_per_coefficient

    @property
    def drag_per_coefficient(self) -> float:
        """1/2 rho A/m [1/m]."""
        return 0.5 * self.air_density * math.pi * self.radius**2 / self.mass

    @property
    def magnus(self) -> float:
        """1/2 rho Cl A r/m []: the Magnus acceleration is magnus * (omega x v)."""
        return self.lift_coefficient * self.drag_per_coefficient * self.radius

    @property
    def air(self) -> Air:
        """Parameters for predictions."""
        return Air(
            drag=self.drag,
            magnus=self.magnus,
            spin_decay=self.spin_decay,
            gravity=self.gravity,
            saturation=self.lift_saturation * self.radius,
        )

    def halved_at(self, spin: float) -> float:
        """Speed at which saturation halves the lift of a spin [m/s]. spin: [rad/s]."""
        return self.lift_saturation * self.radius * spin

    def turn(self, spin: NDArray[np.float64], speed: float) -> NDArray[np.float64]:
        """Computes the turn (3,) [1/s] of a ball from spin (3,) [rad/s] and speed [m/s]."""
        halved_at = self.halved_at(float(np.linalg.norm(spin)))
        turn: NDArray[np.float64] = self.magnus * speed / (speed + halved_at) * spin
        return turn

    def spins(self, turn: NDArray[np.float64], speeds: NDArray[np.float64]) -> NDArray[np.float64]:
        """Computes spins (T, 3) [rad/s] that give `turn` (3,) [1/s] at `speeds` (T,).

        A turn near the saturation limit hardly determines the spin: the result is at most
        `MAX_SATURATED` times the spin without saturation.
        """
        lost = self.lift_saturation * self.radius * float(np.linalg.norm(turn)) / self.magnus
        share = np.maximum(1.0 - lost / np.maximum(speeds, 1e-9), 1.0 / MAX_SATURATED)
        spins: NDArray[np.float64] = turn / (self.magnus * share[:, None])
        return spins


MAX_SATURATED = 10.0
AERODYNAMICS = Aerodynamics()
AIR = AERODYNAMICS.air
