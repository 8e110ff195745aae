"""Asks the ball launcher for balls, and waits for the row of the ball that has left it."""

from __future__ import annotations

import numpy as np

import o80

from ..balls.launches import Launch
from .launcher_aim import drawn_aim
from .parts import LAUNCHER, LAUNCHES, LabSettings
from .watched import Watched


class Launching:
    """Sets the motors, asks for a launch, and finds the ball; never blocks."""

    def __init__(self, settings: LabSettings) -> None:
        self._launcher = Watched(settings.segment(LAUNCHER), read_only=False)
        self._launches = Watched(settings.segment(LAUNCHES))
        self._random = np.random.default_rng(settings.seed)
        self._batch: o80.Batch | None = None
        self._requested = False
        self.number = 0
        """Number of the last launch that was found."""
        self.failed = False
        """The launcher has refused the last launch, or has lost it."""

    def ask(self) -> None:
        """The next ball is wanted: the launcher is asked as soon as it is there and ready."""
        self._batch, self.failed = None, False
        self._aim = drawn_aim(self._random)
        launches = self._launches.frontend()
        if launches is not None:  # a ball of an earlier question is none of ours
            self.number = int(launches.latest().extended.number)

    def came(self) -> Launch | None:
        """The ball that has left the launcher since `ask`; None: none yet."""
        self._go_on()
        launches = self._launches.frontend()
        if launches is None:
            return None
        row = launches.latest().extended
        number = int(row.number)
        if self._batch is None or number <= self.number:
            self.number = min(self.number, number)  # the counterpart was started again
            return None
        self.number = number
        return Launch(np.array(row.position), np.array(row.velocity), np.array(row.spin))

    def _go_on(self) -> None:
        launcher = self._launcher.frontend()
        if launcher is None:
            self.failed = self._batch is not None
            return
        try:
            if self._batch is None:
                if bool(launcher.latest().extended.connected):
                    launcher.add_command(None, self._aim, mode="overwrite")
                    launcher.add_request("launch")
                    self._batch = launcher.pulse()
            elif self._batch.ended:
                self.failed = self._batch.statuses[-1] is not o80.Status.COMPLETED
        except o80.BackendGone:
            self.failed = self._batch is not None
