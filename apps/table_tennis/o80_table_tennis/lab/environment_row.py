"""Row of the environment's process: one for each step of 10 ms, 100 a second."""

from __future__ import annotations

from enum import IntEnum
from typing import Any

import numpy as np

from .parts import ARM, CAMERAS, LAUNCHER, MOTION_CAPTURE, TRACKER, WORLD

WATCHED = (ARM, WORLD, LAUNCHER, CAMERAS, TRACKER, MOTION_CAPTURE)
"""Parts of which a row says whether they are missing."""


class Phase(IntEnum):
    """Phase in which the environment is."""

    waiting = 0
    """Arm or world is missing."""
    returning = 1
    """The arm goes back to its start."""
    launching = 2
    """The launcher was asked, or could not be asked yet; no ball has left it."""
    playing = 3
    over = 4
    """All balls were played."""


EXTENDED: dict[str, Any] = {
    "phase": Phase,
    "missing": dict.fromkeys(WATCHED, np.bool_),
    "arm_row": np.int64,
    "arm_time": np.int64,
    "world_row": np.int64,
    "late": np.int64,
    "ball": np.int64,
    "launch": np.int64,
    "seen": np.bool_,
    "age": np.float64,
    "ball_time": np.int64,
    "observed_at": np.int64,
    "observed_ball": (np.float64, (3,)),
    "true_ball": (np.float64, (3,)),
    "balls_played": np.int64,
    "balls_touched": np.int64,
    "balls_returned": np.int64,
    "balls_given_up": np.int64,
    "launches_failed": np.int64,
}
"""late: rows of the arm that were newer than the one used. launch: number of the launch that is
played, 0 between balls. observed_ball: what the policy observed last; observed_at: the time of the
row of the arm when it did. The ball was seen in images of ball_time, `age` [s] before that.
true_ball: of the world, now."""
UNITS = {"age": "s", "arm_time": "ns", "ball_time": "ns", "observed_at": "ns"} | dict.fromkeys(
    ("observed_ball", "true_ball"), "m"
)
