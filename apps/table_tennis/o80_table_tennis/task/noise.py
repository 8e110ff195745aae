"""Noise of what is observed: of the ball, as a camera system measures it, and of the pressures."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Self


@dataclass(frozen=True)
class NoiseSettings:
    """Standard deviations of what is observed, and how the arm starts. Raises ValueError.

    The noise of each observation is drawn anew (white); that of a camera system is not quite so:
    its velocities are filtered, so that their errors last for a few frames. Reward and end of an
    episode are judged without noise.
    """

    ball_position: float = 0.0
    """Noise of the ball's position, along each axis [m]."""
    ball_velocity: float = 0.0
    """Noise of the ball's velocity, along each axis [m/s]."""
    missed_frames: float = 0.0
    """Share of the observations in which the ball was not seen: they hold the last one."""
    latency: float = 0.0
    """How old the observed ball is [s]."""
    pressure: float = 0.0
    """Noise of the observed pressures, normalised."""
    start_posture: float = 0.0
    """On each joint of the simulated arm at a reset, uniform in plus or minus this [rad]."""

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if not (math.isfinite(value) and value >= 0):
                raise ValueError(f"{field.name} must be 0 or a positive number, got {value}")
        if self.missed_frames >= 1:
            raise ValueError(f"missed_frames must be below 1, got {self.missed_frames}")
        if self.latency > LONGEST_LATENCY:
            raise ValueError(f"latency must be at most {LONGEST_LATENCY} s, got {self.latency}")

    @classmethod
    def tracker(cls) -> Self:
        """Noise that a real camera system leaves on a ball in flight."""
        return cls(ball_position=0.005, ball_velocity=0.1)

    @property
    def of_observations(self) -> bool:
        """Whether anything that is observed differs from what is."""
        return any(getattr(self, f.name) > 0 for f in fields(self) if f.name != "start_posture")


LONGEST_LATENCY = 0.2
"""[s]"""
NO_NOISE = NoiseSettings()
