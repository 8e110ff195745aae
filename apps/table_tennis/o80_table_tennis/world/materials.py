"""Restitutions: what a ball keeps of its velocity when it touches something.

The twins get these numbers as options; predictions and plans of the players use them too.
"""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Restitution:
    """Shares of the velocity relative to a surface that a ball without spin keeps."""

    tangential: float
    """Along the surface."""
    normal: float
    """Along its normal; this part is reversed."""
    friction: float = math.inf
    """Coefficient of friction: a ball whose slip needs more than this slides."""

    @property
    def text(self) -> str:
        """As the simulator wants it: two tangents, the normal, the friction if there is a limit."""
        numbers = [self.tangential, self.tangential, self.normal]
        return " ".join(map(str, numbers + ([self.friction] if self.friction < math.inf else [])))


RACKET_RESTITUTION = Restitution(tangential=0.78, normal=0.78)
"""As published."""
TABLE_RESTITUTION = Restitution(tangential=0.505, normal=0.92, friction=0.25)
"""Normal: median of the bounces of the recorded shots of the ball gun. Tangential: fitted to the
recorded bounces of three sets by studies/fit_bounces.py; a hollow ball that rolls at the end of
the bounce keeps 0.60. Friction: chosen as usual for a celluloid ball on a table; no recorded shot
slides."""
NET_RESTITUTION = Restitution(tangential=0.50, normal=0.15)
"""Chosen; no value is published."""
FLOOR_RESTITUTION = Restitution(tangential=0.70, normal=0.75)
"""Chosen; no value is published."""
