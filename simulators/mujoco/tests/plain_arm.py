"""Simulated arm in Python without requests."""

from typing import Any, ClassVar

import numpy as np

from o80.drivers import Desired, Reading


class PlainArm:
    """Two joints that follow the desired states."""

    actuators = ("shoulder", "elbow")
    simulated = True

    def __init__(self) -> None:
        self.places = np.zeros(2)

    def write(self, desired: Desired) -> None:
        self.places += 0.3 * (np.array(desired.states) - self.places)

    def read(self, reading: Reading) -> None:
        reading.observed = self.places


class LimitedArm(PlainArm):
    """PlainArm with limits of speed and acceleration, so that motions are planned."""

    limits: ClassVar = dict.fromkeys(PlainArm.actuators, (-2.0, 2.0, 1.5, 8.0))  # [rad], [1/s]


class GroupsArm(PlainArm):
    """PlainArm with each joint in a separate group."""

    actuators: Any = dict.fromkeys(PlainArm.actuators, float)

    def write(self, desired: Desired) -> None:
        wanted = [desired.states["shoulder"], desired.states["elbow"]]
        self.places += 0.3 * (np.array(wanted) - self.places)

    def read(self, reading: Reading) -> None:
        reading.observed["shoulder"], reading.observed["elbow"] = self.places
