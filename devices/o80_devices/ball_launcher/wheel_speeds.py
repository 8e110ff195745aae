"""Converts the actuation of a motor to its speed and back, by the launcher's nominal table."""

from __future__ import annotations

import numpy as np

ACTUATIONS = (0.25, 0.30, 0.40, 0.50, 0.60, 0.70, 0.80, 0.90, 1.00)
SPEEDS = (0.0, 489.0, 1865.0, 2694.0, 3170.0, 3434.0, 3615.0, 3931.0, 3970.0)
"""[1/min]"""


def speed_of(actuation: float) -> float:
    """Speed of a motor [1/min] for an actuation in [0, 1]."""
    return float(np.interp(actuation, ACTUATIONS, SPEEDS))


def actuation_of(speed: float) -> float:
    """Actuation for a speed [1/min]. Raises ValueError for a speed out of range."""
    if not 0.0 <= speed <= SPEEDS[-1]:
        raise ValueError(f"the speed must be between 0 and {SPEEDS[-1]:g} 1/min, got {speed:g}")
    return float(np.interp(speed, SPEEDS, ACTUATIONS))
