"""Asks the ball launcher for balls like the simulated shots `wide`, and waits for their rows.

The recorded launcher stands on the floor and shoots faster than the policies know. Here it is
raised so far that its balls leave it where those of the ball gun begin.
"""

from __future__ import annotations

import math

import numpy as np

import o80
from o80_devices.ball_launcher.launch_model import LAUNCH_MODEL
from o80_devices.ball_launcher.wheel_speeds import actuation_of

from ..balls.launches import WIDE, Launch
from ..balls.recordings import Frame
from .parts import COUNTERPARTS, LAUNCHER, LabSettings
from .watched import Watched

_X, _Y, _Z = WIDE.position
PLACE = Frame(offset=(_X, _Y, _Z - LAUNCH_MODEL.muzzle[2]), yaw=-math.pi / 2)
"""Place of the launcher in the world: it shoots along -y."""
TOP_SPINS = (0.0, 60.0)
"""Least and most [rad/s]: with the scatter of the launcher, within those of `wide`."""
SPREAD = 0.2
"""Spread of each component of the velocity, either way [m/s]; the launcher adds its scatter."""


def drawn_aim(rng: np.random.Generator) -> list[float]:
    """Angles and motors (5,) of the launcher for another ball; the same `rng`, the same aim."""
    share = rng.uniform(-1.0, 1.0, 3)
    velocity = np.array(WIDE.velocity) + SPREAD * share
    least, most = TOP_SPINS
    return aim_at(velocity, rng.uniform(least, most))


def aim_at(velocity: np.ndarray[tuple[int, ...], np.dtype[np.float64]], spin: float) -> list[float]:
    """For a velocity (3,) in the world [m/s] and a top spin [rad/s]: the launch model, inverted."""
    model = LAUNCH_MODEL
    aside, ahead, up = velocity[0], -velocity[1], velocity[2]
    difference = (spin - model.spin) / model.spin_gain  # of the upper motors to the lower one
    speed = float(np.linalg.norm(velocity))
    bottom = (speed - 2 * model.top_gain * difference) / (2 * model.top_gain + model.bottom_gain)
    azimuth, altitude = math.atan2(aside, ahead), math.atan2(up, math.hypot(aside, ahead))
    phi = 0.5 + (azimuth - model.azimuth) / model.azimuth_range
    theta = 0.5 + (altitude - model.altitude - model.lift * difference) / model.altitude_range
    upper = actuation_of(bottom + difference)
    return [phi, theta, upper, upper, actuation_of(bottom)]


class Launching:
    """Sets the motors, asks for a launch, and finds the ball; never blocks."""

    def __init__(self, settings: LabSettings) -> None:
        self._launcher = Watched(settings.segment(LAUNCHER), read_only=False)
        self._launches = Watched(settings.segment(COUNTERPARTS))
        self._random = np.random.default_rng(settings.seed)
        self._batch: o80.Batch | None = None
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
