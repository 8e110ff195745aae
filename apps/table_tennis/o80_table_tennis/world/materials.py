"""Restitutions: shares of its velocity that a ball keeps in a contact.

These numbers are options of the twins, and parameters of predictions and of the players' plans.
"""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Restitution:
    """Shares of the relative velocity that a ball without spin keeps at a surface."""

    tangential: float
    """Share along the surface."""
    normal: float
    """Share along the normal, which is reversed."""
    friction: float = math.inf
    """Coefficient of friction; a ball that needs more slides."""

    @property
    def text(self) -> str:
        """Text for the simulator: two tangents, the normal, the friction if limited."""
        numbers = [self.tangential, self.tangential, self.normal]
        return " ".join(map(str, numbers + ([self.friction] if self.friction < math.inf else [])))


RACKET_RESTITUTION = Restitution(tangential=0.78, normal=0.78)
"""Published value."""
TABLE_RESTITUTION = Restitution(tangential=0.505, normal=0.92, friction=0.25)
"""Normal: median of bounces in the ball gun's recorded shots. Tangential: fitted to the recorded
bounces of three sets by studies/fit_bounces.py; a hollow ball that rolls at the end of the
bounce keeps 0.60. Friction: usual value of a celluloid ball on a table; no recorded shot
slides."""
NET_RESTITUTION = Restitution(tangential=0.50, normal=0.15)
"""Assumed; no value is published."""
FLOOR_RESTITUTION = Restitution(tangential=0.70, normal=0.75)
"""Assumed; no value is published."""
