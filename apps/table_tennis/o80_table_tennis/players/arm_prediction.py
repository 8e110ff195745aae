"""Predicts the arm's state when an action begins to act, from the actions that are still in flight.

During its dead time the arm follows earlier commands. From the present state and those commands,
a model of muscles and links is integrated over the dead time of each joint.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from o80.base.arrays import FloatArray

from ..world.arm import JOINTS
from ..world.timing import STEP
from .arm_dynamics import ArmModel
from .pressure_control import MusclePair, PressureLag

INTEGRATION_STEP = 0.0025
"""Longest integration step of the model [s]."""


@dataclass(frozen=True)
class ArmState:
    """State of the arm, each joint at its own time."""

    q: FloatArray
    """(4,) [rad]"""
    dq: FloatArray
    """(4,) [rad/s]"""
    pressures: FloatArray
    """(8,) normalised, in the muscles"""


class ArmPredictor:
    """Predicts each joint over its dead time."""

    def __init__(
        self,
        arm: ArmModel,
        muscles: MusclePair,
        lag: PressureLag,
        dead_time: tuple[float, ...],
        begin: float,
    ) -> None:
        """`begin`: time from an observation to the command of its action [s]."""
        self._arm, self._muscles, self._lag = arm, muscles, lag
        self._dead_time, self._begin = dead_time, begin
        self.longest = max(dead_time)
        """Longest dead time [s]."""
        self._commanded: deque[FloatArray] = deque(maxlen=2 + math.ceil(self.longest / STEP))

    def start(self, commanded: FloatArray) -> None:
        """Sets the commanded pressures (8,) of an arm at rest."""
        self._commanded.clear()
        self._commanded.append(commanded)

    def ask(self, commanded: FloatArray) -> None:
        """Adds the pressures (8,) that are commanded in the step that begins now."""
        self._commanded.append(commanded)

    def predict(self, now: ArmState) -> ArmState:
        """Predicts each joint's state at the time when a command sent now begins to act."""
        if self.longest == 0.0:
            return now
        q, dq, pressures = now.q.copy(), now.dq.copy(), now.pressures.copy()
        result = ArmState(q.copy(), dq.copy(), pressures.copy())
        steps = math.ceil(self.longest / INTEGRATION_STEP)
        duration = self.longest / steps
        for number in range(steps + 1):
            if number > 0:
                targets = self._targets((number - 0.5) * duration)
                pressures = self._lag.after(pressures, targets, duration)
                torque = self._muscles.torque(pressures, q)
                dq = self._arm.speeds_after(q, dq, torque, duration)
                q = q + duration * dq
            for joint, dead_time in enumerate(self._dead_time):
                if min(round(dead_time / duration), steps) == number:
                    part = slice(2 * joint, 2 * joint + 2)
                    result.q[joint], result.dq[joint] = q[joint], dq[joint]
                    result.pressures[part] = pressures[part]
        return result

    def _targets(self, time: float) -> FloatArray:
        """Returns the pressures (8,) that act at `time` from now [s]."""
        targets = np.empty(2 * JOINTS)
        for joint, dead_time in enumerate(self._dead_time):
            # number of commands back from the newest one, which is sent from begin - STEP on
            back = math.floor((dead_time + self._begin - time) / STEP)
            index = max(len(self._commanded) - 1 - max(back, 0), 0)
            part = slice(2 * joint, 2 * joint + 2)
            targets[part] = self._commanded[index][part]
        return targets
