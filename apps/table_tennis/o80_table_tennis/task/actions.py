"""Actions: small changes of eight muscle pressures.

Muscles are in the arm's order: agonist and antagonist of joint 1, of joint 2, and so
on. Normalised pressures are from 0 (least of the muscle's range) to 1 (largest).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from o80.base.arrays import FloatArray

FINE = 0.05
"""Factor of the actions in the published fine configuration."""
COARSE = 1.0
"""Factor of the actions in the published coarse configuration."""

_ZERO, _ONE, _MINUS_ONE = np.array(0.0), np.array(1.0), np.array(-1.0)  # faster than numbers


def largest_change(factor: float) -> float:
    """Returns the largest change of a normalised pressure by one action."""
    return 0.5 * math.tanh(0.5 * factor)


def changed_pressures(
    pressures: FloatArray, action: NDArray[np.floating[Any]], *, factor: float = FINE
) -> FloatArray:
    """Applies actions (..., 8) in [-1, 1] to normalised pressures; clamps to [0, 1]; a fresh array.

    delta = sigmoid(factor * action) - 1/2, as published, which is tanh(factor * action / 2) / 2.
    Raises ValueError for a wrong shape or a number that is not finite; actions outside of
    [-1, 1] are clamped.
    """
    action = np.asarray(action, dtype=np.float64)
    if action.shape != pressures.shape:
        raise ValueError(f"an action must have shape {pressures.shape}, got {action.shape}")
    # the sum of squares is finite only if all numbers are, and not too large
    if not math.isfinite(np.vdot(action, action)) and not np.isfinite(action).all():
        raise ValueError(f"an action must be finite, got {action}")
    changed: FloatArray = np.minimum(np.maximum(action, _MINUS_ONE), _ONE)
    changed *= 0.5 * factor
    np.tanh(changed, out=changed)
    changed *= 0.5
    changed += pressures
    np.maximum(changed, _ZERO, out=changed)
    np.minimum(changed, _ONE, out=changed)
    return changed
