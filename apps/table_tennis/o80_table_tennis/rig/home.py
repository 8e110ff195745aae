"""Start of episodes, and the return of a real-time arm to it."""

from __future__ import annotations

import time
from copy import copy

import numpy as np

import o80
from o80.base.arrays import FloatArray
from o80.rows.layout import field_view

from ..world.arm import JOINTS
from ..world.timing import ITERATIONS
from .rig import MOTION

RETURN_SECONDS = 0.6
"""Duration of the return to the start pressures [s]."""
LONGEST_RETURN = 4.0
"""Timeout of the return; then the episode begins at the arm's present position [s]."""
SETTLED_SPEED = 0.02
"""Speed of each joint below which the arm is at rest [rad/s]."""
SETTLED_ANGLE = 0.05
"""Tolerance of each joint at the start [rad]."""
TIMEOUT = 5.0
"""Longest wait for a row [s]."""


class Home:
    """Start of an arm: its position when this object is created."""

    def __init__(self, arm: o80.Frontend) -> None:
        self._arm = arm
        row = arm.history(1).rows
        self.pressures: FloatArray = row["desired"][0].copy()
        """(8,) raw"""
        self.angles: FloatArray = field_view(row, *MOTION)[0, :JOINTS].copy()
        """(4,) [rad]"""

    def of(self, arm: o80.Frontend) -> Home:
        """Returns the same start for another arm."""
        other = copy(self)
        other._arm = arm
        return other

    def go(self) -> None:
        """Moves the arm to the start by commands, as necessary for a real arm."""
        self.begin().wait(timeout=RETURN_SECONDS + TIMEOUT)
        end = time.monotonic() + LONGEST_RETURN
        while time.monotonic() < end and not self.reached:
            self._arm.wait_for(self._arm.published + 10 * ITERATIONS, timeout=TIMEOUT)

    def begin(self) -> o80.Batch:
        """Sends a motion to the start pressures, without waiting."""
        self._arm.add_command(None, self.pressures, duration=RETURN_SECONDS, mode="overwrite")
        return self._arm.pulse()

    @property
    def reached(self) -> bool:
        """Whether the arm is at rest at the start, with the start pressures desired."""
        row = self._arm.history(1).rows
        motion = field_view(row, *MOTION)[0]
        still = np.abs(motion[JOINTS:]).max() < SETTLED_SPEED
        near = np.abs(motion[:JOINTS] - self.angles).max() < SETTLED_ANGLE
        return bool(still and near and np.array_equal(row["desired"][0], self.pressures))
