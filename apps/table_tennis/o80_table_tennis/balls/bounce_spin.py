"""The spin of a recorded ball after a bounce."""

from __future__ import annotations

import numpy as np

from o80.base.arrays import FloatArray

from ..physics.aerodynamics import AERODYNAMICS
from ..physics.impact import bounced


def spin_after(velocity: FloatArray, turn: FloatArray, spin: FloatArray | None) -> FloatArray:
    """Spin (3,) [rad/s] after a bounce, by the law of the bounce.

    `velocity` (1, 3) [m/s] and `turn` (3,) [1/s] are those before it, as is `spin` (3,) [rad/s];
    None: what the turn says.
    """
    if spin is None:
        spin = AERODYNAMICS.spins(turn, np.linalg.norm(velocity, axis=1))[0]
    return bounced(velocity[0], spin).spin
