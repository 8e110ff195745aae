"""Place and size of the table, height of the net, and the table's restitutions."""

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
"""Where on the opponent's half a ball should land, as published [m]."""
NET_Y = vector(geom("net"), "pos")[1]
"""Plane of the net: greater is the opponent's half [m]."""
NET_HEIGHT = full_size(geom("net"))[2]
"""Above the table [m]."""


@dataclass(frozen=True)
class Table:
    """A table in the world frame: x across, y along towards the opponent, z up; lengths in [m]."""

    centre: Vector = TABLE_CENTRE
    size: Vector = TABLE_SIZE
    normal_restitution: float = TABLE_RESTITUTION.normal
    """Share of the vertical speed kept."""
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
