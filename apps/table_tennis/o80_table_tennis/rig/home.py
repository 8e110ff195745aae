"""Where episodes begin, and how an arm that runs by its clock comes back there."""

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
"""After this the episode begins from wherever the arm stands [s]."""
SETTLED_SPEED = 0.02
"""Below this speed of every joint the arm stands [rad/s]."""
SETTLED_ANGLE = 0.05
"""The arm is back where it started when every joint is this near [rad]."""
TIMEOUT = 5.0
"""Longest wait for a row [s]."""


class Home:
    """The start of an arm: where it stands when this is made."""

    def __init__(self, arm: o80.Frontend) -> None:
        self._arm = arm
        row = arm.history(1).rows
        self.pressures: FloatArray = row["desired"][0].copy()
        """(8,) raw"""
        self.angles: FloatArray = field_view(row, *MOTION)[0, :JOINTS].copy()
        """(4,) [rad]"""

    def of(self, arm: o80.Frontend) -> Home:
        """The same place for another arm."""
        other = copy(self)
        other._arm = arm
        return other

    def go(self) -> None:
        """To the start by commands, as a real arm must."""
        self.begin().wait(timeout=RETURN_SECONDS + TIMEOUT)
        end = time.monotonic() + LONGEST_RETURN
        while time.monotonic() < end and not self.reached:
            self._arm.wait_for(self._arm.published + 10 * ITERATIONS, timeout=TIMEOUT)

    def begin(self) -> o80.Batch:
        """Sends the pressures back to those of the start, and does not wait."""
        self._arm.add_command(None, self.pressures, duration=RETURN_SECONDS, mode="overwrite")
        return self._arm.pulse()

    @property
    def reached(self) -> bool:
        """In its newest row the arm stands where it started, and is asked to."""
        row = self._arm.history(1).rows
        motion = field_view(row, *MOTION)[0]
        still = np.abs(motion[JOINTS:]).max() < SETTLED_SPEED
        near = np.abs(motion[:JOINTS] - self.angles).max() < SETTLED_ANGLE
        return bool(still and near and np.array_equal(row["desired"][0], self.pressures))
