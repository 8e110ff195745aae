"""Shots of a ball gun without any file: drawn, with drag, top spin and one bounce on the table."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..physics.aerodynamics import AERODYNAMICS, Aerodynamics
from ..physics.prediction import predict
from ..world.ball import BALL_GUN_SPIN
from ..world.scene import Vector
from ..world.table import TABLE, Table
from .frame_stamps import FRAME_PERIOD
from .trajectories import BallTrajectory


@dataclass(frozen=True)
class ShotVariation:
    """How simulated shots start: means and standard deviations of flights fitted to recordings."""

    position: Vector = (0.46, 2.95, 1.37)
    """[m]"""
    position_deviation: Vector = (0.01, 0.013, 0.016)
    """[m]"""
    velocity: Vector = (0.24, -4.14, 2.28)
    """[m/s]"""
    velocity_deviation: Vector = (0.09, 0.07, 0.17)
    """[m/s]"""
    spin: Vector = BALL_GUN_SPIN
    """[rad/s]"""
    spin_deviation: Vector = (2.0, 3.0, 2.0)
    """[rad/s]"""
    duration: float = 1.28
    """[s]"""
    period: float = FRAME_PERIOD
    """Between two rows, as the cameras give them [s]."""


def simulated_shot(
    rng: np.random.Generator,
    *,
    variation: ShotVariation | None = None,
    aerodynamics: Aerodynamics = AERODYNAMICS,
    table: Table = TABLE,
) -> BallTrajectory:
    """A shot towards the arm that bounces once on the table; the same `rng` gives the same shot."""
    variation = variation or ShotVariation()
    for _ in range(1000):
        position = rng.normal(variation.position, variation.position_deviation)
        velocity = rng.normal(variation.velocity, variation.velocity_deviation)
        spin = rng.normal(variation.spin, variation.spin_deviation)
        flight = predict(
            position,
            velocity,
            variation.duration,
            spin=spin,
            period=variation.period,
            aerodynamics=aerodynamics,
            table=table,
        )
        if len(flight.bounce_times) == 1:
            return BallTrajectory(
                "simulated shot", flight.stamps, flight.positions, flight.velocities, flight.spins
            )
    raise ValueError(
        f"no shot of {variation} bounces exactly once on the table; choose other means"
    )
