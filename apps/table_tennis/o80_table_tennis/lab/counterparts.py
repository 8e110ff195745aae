"""Fakes of the hardware behind the drivers, and the environment's client of the launcher.

The muzzle of the launcher is at the mean start of the shots `wide`.
"""

from __future__ import annotations

import math
import threading
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

import o80
from o80.drivers import Reading, Seed, option
from o80_devices.ball_launcher.launch_model import LAUNCH_MODEL, Launch
from o80_devices.fakes.ball_launcher import Behaviour, FakeLauncher
from o80_devices.fakes.qualisys import FakeQualisys, Pose

from ..balls import launches
from ..balls.launcher_shots import drawn_aim
from ..balls.launches import WIDE
from ..world.table import TABLE
from .parts import COUNTERPARTS, LAUNCHER, SUBJECTS, LabSettings
from .processes import Watched

_X, _Y, _Z = WIDE.position
PLACE = ((_X, _Y, _Z - LAUNCH_MODEL.muzzle[2]), -math.pi / 2)
"""Position [m] and yaw [rad] of the launcher in the world; shots fly along -y."""
BALL = dict.fromkeys(("position", "velocity", "spin"), (np.float64, (3,)))
UNTURNED = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)


class Counterparts:
    """Driver of the fakes; a row holds the last launch, in the world; number 0: none yet."""

    simulated = True
    frequency = 200.0
    extended: ClassVar = {"number": np.int64, **BALL}
    units: ClassVar = {"position": "m", "velocity": "m/s", "spin": "rad/s"}

    @dataclass
    class Config:
        launcher: str = option("", "address at which the fake launcher listens")
        qualisys: int = option(0, "port of the fake motion capture")
        arm: str = option("", "segment of the arm")
        seed: Seed = Seed(0)  # noqa: RUF009

    def __init__(self, config: Config) -> None:
        self._config, self._row = config, dict[str, Any](number=0)

    def start(self) -> None:
        seed = int(self._config.seed)
        behaviour = Behaviour(state_time=0.1, launch_time=0.4, magazine=10**6, seed=seed)
        self._arm, self._lock = Watched(self._config.arm), threading.Lock()
        self._launcher = FakeLauncher(behaviour, on_launch=self._on_launch)
        self._launcher.bind(self._config.launcher)
        self._server = FakeQualisys(SUBJECTS, port=self._config.qualisys, poses=self._pose)
        self._server.__enter__()

    def read(self, reading: Reading) -> None:
        self._launcher.step(reading.time)
        for name, value in self._row.items():
            reading.extended[name] = value

    def stop(self) -> None:
        self._server.__exit__(None, None, None)
        self._launcher.close()
        self._arm.close()

    def _on_launch(self, ball: Launch) -> None:
        self._row = {"number": self._row["number"] + 1} | vars(ball.placed(*PLACE))

    def _pose(self, name: str, when: int) -> Pose | None:
        """Returns a body's pose at a time [ns]; None: unseen. Called in connection threads."""
        if name != "racket":
            return (TABLE.centre if name == "table" else (0.0, 0.0, 0.0)), UNTURNED
        with self._lock:
            if self._arm.missing or (arm := self._arm.now) is None:
                return None
            row: Any = arm.latest()
        racket, since = row.extended, (when - row.time) * 1e-9
        position = racket.racket_position + since * racket.racket_velocity
        return position.tolist(), racket.racket_rotation.tolist()


class Launching:
    """Sets the motors, requests a launch, and detects the launched ball; never blocks."""

    def __init__(self, settings: LabSettings) -> None:
        self._launcher = Watched(settings.segment(LAUNCHER), read_only=False)
        self._launches = Watched(settings.segment(COUNTERPARTS))
        self._random = np.random.default_rng(settings.seed)
        self.number = 0
        """Number of the last detected launch."""

    def ask(self) -> None:
        """Requests the next ball, which `came` sends as soon as the launcher is connected."""
        self._batch: o80.Batch | None = None
        self.failed = False
        """Whether the last launch was refused or lost."""
        self._aim = drawn_aim(self._random)
        if (row := self._newest()) is not None:
            self.number = int(row.number)  # earlier launches are of other requests

    def came(self) -> launches.Launch | None:
        """Returns the ball that was launched since `ask`; None: none yet."""
        launcher, row = self._launcher.now, self._newest()
        if self._batch is not None:
            self.failed = launcher is None or (
                self._batch.ended and self._batch.statuses[-1] is not o80.Status.COMPLETED
            )
        elif launcher is not None and bool(launcher.latest().extended.connected):
            launcher.add_command(None, self._aim, mode="overwrite")
            launcher.add_request("launch")
            self._batch = launcher.pulse()
        if row is None:
            return None
        if self._batch is None or row.number <= self.number:
            self.number = min(self.number, int(row.number))  # the counterparts were restarted
            return None
        self.number = int(row.number)
        return launches.Launch(np.array(row.position), np.array(row.velocity), np.array(row.spin))

    def _newest(self) -> Any:
        return None if (frontend := self._launches.now) is None else frontend.latest().extended
