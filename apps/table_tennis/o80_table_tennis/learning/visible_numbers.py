"""Which numbers of an observation a policy sees."""

from __future__ import annotations

import numpy as np

from o80.base.arrays import Float32Array

from ..players.conditions import Conditions
from ..task.full_observation import full_observation

BALL_PARTS = (
    *("ball_position", "ball_velocity", "spin"),
    *("crossing_position", "crossing_velocity", "crossing_time"),
)
"""Parts of the full observation that tell of the ball; the others tell of the arm and the time."""


def visible_numbers(conditions: Conditions, size: int, *, blind: bool) -> Float32Array:
    """(M,) 1 for the numbers of an observation that a policy sees; a blind one sees no ball.

    Raises ValueError for a blind policy without a clock.
    """
    visible = np.ones(size, np.float32)
    if blind:
        full = full_observation(conditions.observation)
        if full is None:
            raise ValueError(
                "a blind policy needs the time, which the published observation does not hold: "
                "give observation='full'"
            )
        for part in BALL_PARTS:
            visible[full.places()[part]] = 0.0
    return visible
