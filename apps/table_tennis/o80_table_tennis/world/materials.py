"""Restitutions: the shares of its velocity that a ball keeps when it touches something.

The twins get these numbers as options; predictions and plans of the players use them too.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Restitution:
    """Shares of the velocity relative to a surface that a ball keeps."""

    tangential: float
    """Along the surface."""
    normal: float
    """Along its normal; this part is reversed."""

    @property
    def axes(self) -> tuple[float, float, float]:
        """Two tangents, then the normal, as the simulator wants them."""
        return self.tangential, self.tangential, self.normal


RACKET_RESTITUTION = Restitution(tangential=0.78, normal=0.78)
"""As published."""
TABLE_RESTITUTION = Restitution(tangential=0.70, normal=0.92)
"""Medians of the bounces of the recorded shots of the ball gun, from the flights fitted before and
after them (published: 0.73 and 0.92)."""
NET_RESTITUTION = Restitution(tangential=0.50, normal=0.15)
"""Chosen; no value is published."""
FLOOR_RESTITUTION = Restitution(tangential=0.70, normal=0.75)
"""Chosen; no value is published."""
