"""Where the table stands, and how a ball leaves it."""

from __future__ import annotations

from dataclasses import dataclass

BALL_RADIUS = 0.02
"""Radius of the ball [m]."""


@dataclass(frozen=True)
class Table:
    """A table in the world frame: x across, y along towards the opponent, z up; lengths in [m]."""

    centre: tuple[float, float, float] = (0.4, 1.57, 0.755)
    size: tuple[float, float, float] = (1.525, 2.74, 0.04)
    normal_restitution: float = 0.92
    """Share of the vertical speed kept (median of the bounces of the recorded shots)."""
    tangential_restitution: float = 0.70
    """Share of the horizontal velocity kept (median of the bounces of the recorded shots, from the
    flights fitted before and after; coarser estimates said 0.67)."""

    @property
    def top(self) -> float:
        """Height of the surface [m]."""
        return self.centre[2] + self.size[2] / 2

    @property
    def bounce_height(self) -> float:
        """Height of the ball's centre when it touches the surface [m]."""
        return self.top + BALL_RADIUS

    def carries(self, x: float, y: float) -> bool:
        """Whether the surface lies under the point (x, y) [m]."""
        return (
            abs(x - self.centre[0]) <= self.size[0] / 2
            and abs(y - self.centre[1]) <= self.size[1] / 2
        )
