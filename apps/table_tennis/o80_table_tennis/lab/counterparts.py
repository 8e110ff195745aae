"""The process that plays the hardware behind the drivers: the ball launcher, the motion capture.

The fake launcher draws each ball by its launch model; the balls that have left it are rows of a
segment. The fake Qualisys server sees the racket of the arm, its base and the table.
"""

from __future__ import annotations

import argparse
import signal
import threading
import time
from collections.abc import Sequence
from types import FrameType
from typing import Any

import numpy as np

import o80
from o80.base.descriptors import open_standard_streams
from o80_devices.ball_launcher.launch_model import Launch
from o80_devices.fakes.ball_launcher import Behaviour, FakeLauncher
from o80_devices.fakes.qualisys import FakeQualisys, Pose

from ..world.table import TABLE
from .launcher_aim import PLACE
from .parts import LAUNCHES_WITHIN, SETS_WITHIN, SUBJECTS
from .watched import Watched

RATE = 50.0
"""Rows a second of the launches; one more at each launch."""
STEP = 0.002
"""Between two looks of the fake launcher while it is busy [s]."""
UNTURNED = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
EXTENDED = {
    "number": np.int64,
    "capture_time": np.int64,
    "position": (np.float64, (3,)),
    "velocity": (np.float64, (3,)),
    "spin": (np.float64, (3,)),
}
"""A launch in the world; number 0: none yet."""
UNITS = {"capture_time": "ns", "position": "m", "velocity": "m/s", "spin": "rad/s"}


class Launches:
    """The launcher, and the row of its last launch."""

    def __init__(self, address: str, seed: int) -> None:
        self.came = threading.Event()
        self.row: dict[str, Any] = {"number": 0, "capture_time": 0}
        behaviour = Behaviour(
            state_time=SETS_WITHIN, launch_time=LAUNCHES_WITHIN, magazine=10**6, seed=seed
        )
        self._fake = FakeLauncher(behaviour, on_launch=self._launched)
        self._address = address

    def _launched(self, ball: Launch) -> None:
        placed = ball.placed(PLACE.offset, PLACE.yaw)
        self.row = {
            "number": self.row["number"] + 1,
            "capture_time": time.monotonic_ns(),
            "position": placed.position,
            "velocity": placed.velocity,
            "spin": placed.spin,
        }
        self.came.set()

    def serve(self, stop: threading.Event) -> None:
        """Until `stop`."""
        self._fake.bind(self._address)
        while not stop.is_set():
            self._fake.step(time.monotonic_ns(), wait=0.1)
            if self._fake.busy is not None:
                stop.wait(STEP)
        self._fake.close()


class Poses:
    """Poses that the motion capture would see: racket (from the rows of the arm), table, base."""

    def __init__(self, arm: str) -> None:
        self._arm = Watched(arm)
        self._lock = threading.Lock()  # each connection is served by a thread

    def at(self, name: str, when: int) -> Pose | None:
        """A body at a time [ns]; None: it is not there."""
        if name == "table":
            return TABLE.centre, UNTURNED
        if name == "base":
            return (0.0, 0.0, 0.0), UNTURNED
        with self._lock:
            arm = None if self._arm.missing else self._arm.frontend()
            if arm is None:
                return None
            row = arm.latest()
        racket = row.extended
        since = (when - row.time) * 1e-9
        position = racket.racket_position + since * racket.racket_velocity
        return position.tolist(), racket.racket_rotation.tolist()


def run(launcher: str, qualisys: int, arm: str, launches: str, seed: int) -> None:
    """Serves until SIGTERM or Ctrl-C."""
    stop = threading.Event()

    def end(_number: int, _frame: FrameType | None) -> None:
        stop.set()

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, end)
    balls = Launches(launcher, seed)
    server = threading.Thread(target=balls.serve, args=(stop,))
    server.start()
    try:
        with (
            FakeQualisys(SUBJECTS, port=qualisys, poses=Poses(arm).at),
            o80.Backend(launches, extended=EXTENDED, units=UNITS, frequency=RATE) as backend,
        ):
            while not stop.is_set():
                balls.came.clear()
                backend.publish(extended=balls.row)
                backend.step()
                balls.came.wait(1.0 / RATE)
    finally:
        stop.set()
        server.join()


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(prog="python -m o80_table_tennis.lab.counterparts")
    parser.add_argument("--launcher", required=True, help="where the fake launcher listens")
    parser.add_argument("--qualisys", type=int, required=True, help="port of the motion capture")
    parser.add_argument("--arm", required=True, help="segment of the arm")
    parser.add_argument("--launches", required=True, help="segment for the balls that have left")
    parser.add_argument("--seed", type=int, default=0)
    run(**vars(parser.parse_args(arguments)))


if __name__ == "__main__":
    open_standard_streams()
    main()
