"""The driver that plays the hardware behind the drivers: the ball launcher, the motion capture."""

from __future__ import annotations

import threading
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from o80.drivers import Reading, Seed, option
from o80_devices.ball_launcher.launch_model import Launch
from o80_devices.fakes.ball_launcher import Behaviour, FakeLauncher
from o80_devices.fakes.qualisys import FakeQualisys, Pose

from ..world.table import TABLE
from .launching import PLACE
from .parts import SUBJECTS
from .watched import Watched

UNTURNED = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)


class Counterparts:
    """Its row is the last launch, in the world, as the launch model drew it; number 0: none yet.

    The fake launcher takes its time. The fake Qualisys server sees the racket of the arm, its base
    and the table.
    """

    simulated = True
    frequency = 200.0
    extended: ClassVar = {
        "number": np.int64,
        "capture_time": np.int64,
        "position": (np.float64, (3,)),
        "velocity": (np.float64, (3,)),
        "spin": (np.float64, (3,)),
    }
    units: ClassVar = {"capture_time": "ns", "position": "m", "velocity": "m/s", "spin": "rad/s"}

    @dataclass
    class Config:
        launcher: str = option("", "address at which the fake launcher listens")
        qualisys: int = option(0, "port of the fake motion capture")
        arm: str = option("", "segment of the arm")
        seed: Seed = Seed(0)  # noqa: RUF009

    def __init__(self, config: Config) -> None:
        self._config, self._now = config, 0
        self._row: dict[str, Any] = {"number": 0}

    def start(self) -> None:
        behaviour = Behaviour(
            state_time=0.1, launch_time=0.4, magazine=10**6, seed=int(self._config.seed)
        )
        self._arm, self._lock = Watched(self._config.arm), threading.Lock()
        self._launcher = FakeLauncher(behaviour, on_launch=self._on_launch)
        self._launcher.bind(self._config.launcher)
        self._server = FakeQualisys(SUBJECTS, port=self._config.qualisys, poses=self._pose)
        self._server.__enter__()

    def read(self, reading: Reading) -> None:
        self._now = reading.time
        self._launcher.step(self._now)
        for name, value in self._row.items():
            reading.extended[name] = value

    def stop(self) -> None:
        self._server.__exit__(None, None, None)
        self._launcher.close()
        self._arm.close()

    def _on_launch(self, ball: Launch) -> None:
        placed = ball.placed(PLACE.offset, PLACE.yaw)
        self._row = {"number": self._row["number"] + 1, "capture_time": self._now}
        self._row |= {name: getattr(placed, name) for name in ("position", "velocity", "spin")}

    def _pose(self, name: str, when: int) -> Pose | None:
        """Pose of a body at a time [ns]; None: it is not there. Each connection is a thread."""
        if name != "racket":
            return (TABLE.centre if name == "table" else (0.0, 0.0, 0.0)), UNTURNED
        with self._lock:
            arm = None if self._arm.missing else self._arm.frontend()
            if arm is None:
                return None
            row: Any = arm.latest()
        racket, since = row.extended, (when - row.time) * 1e-9
        position = racket.racket_position + since * racket.racket_velocity
        return position.tolist(), racket.racket_rotation.tolist()
