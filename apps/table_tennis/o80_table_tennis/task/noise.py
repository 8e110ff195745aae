"""Observation noise of the ball, as from a camera system, and of the pressures."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Self


@dataclass(frozen=True)
class NoiseSettings:
    """Noise of observations and of the arm's start. Raises ValueError for wrong numbers.

    The noise is white. The noise of a camera system is not quite white: its velocities are
    filtered, so that errors last for a few frames. Reward and end of an episode are
    computed without noise.
    """

    ball_position: float = 0.0
    """Noise of the ball's position, along each axis [m]."""
    ball_velocity: float = 0.0
    """Noise of the ball's velocity, along each axis [m/s]."""
    missed_frames: float = 0.0
    """Share of observations without a sighting of the ball; they repeat the last one."""
    latency: float = 0.0
    """Age of the observed ball [s]."""
    pressure: float = 0.0
    """Noise of the observed pressures, normalised."""
    start_posture: float = 0.0
    """Largest deviation of each simulated joint at a reset, either way, uniform [rad]."""

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
        """Returns the noise of a real camera system for a ball in flight."""
        return cls(ball_position=0.005, ball_velocity=0.1)

    @property
    def of_observations(self) -> bool:
        """Whether observations differ from the true state."""
        return any(getattr(self, f.name) > 0 for f in fields(self) if f.name != "start_posture")


LONGEST_LATENCY = 0.2
"""Limit of the latency [s]."""
NO_NOISE = NoiseSettings()
