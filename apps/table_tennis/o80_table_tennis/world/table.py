"""Place, size and restitutions of the table, and height of the net."""

from __future__ import annotations

from dataclasses import dataclass

from .ball import BALL_RADIUS
from .materials import TABLE_RESTITUTION
from .scene import Vector, full_size, geom, vector

TABLE_CENTRE = vector(geom("table"), "pos")
"""World frame [m]."""
TABLE_SIZE = full_size(geom("table"))
"""[m]"""
TARGET: Vector = (0.0, 2.5, 0.78)
"""Published target on the opponent's half [m]."""
NET_Y = vector(geom("net"), "pos")[1]
"""y of the net; the opponent's half is beyond [m]."""
NET_HEIGHT = full_size(geom("net"))[2]
"""Height of the net above the table [m]."""


@dataclass(frozen=True)
class Table:
    """Table in the world frame: x across, y towards the opponent, z up; lengths in [m]."""

    centre: Vector = TABLE_CENTRE
    size: Vector = TABLE_SIZE
    normal_restitution: float = TABLE_RESTITUTION.normal
    """Share of the vertical speed that a ball keeps."""
    tangential_restitution: float = TABLE_RESTITUTION.tangential
    """Share of the horizontal velocity that a ball without spin keeps."""
    friction: float = TABLE_RESTITUTION.friction
    """Coefficient of friction."""

    @property
    def top(self) -> float:
        """Height of the surface [m]."""
        return self.centre[2] + self.size[2] / 2

    @property
    def bounce_height(self) -> float:
        """Height of the ball's centre when it touches the surface [m]."""
        return self.top + BALL_RADIUS


TABLE = Table()
