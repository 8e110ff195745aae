"""Python drivers for tests, in a module that other processes also import."""

import os
import signal
import time
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path
from typing import Any, Literal

import numpy as np

import o80
from o80.drivers import Desired, Reading, Seed, option


class Colour(Enum):
    RED = 1
    BLUE = 2


class RoomSensor:
    """A pure sensor with options of all kinds."""

    name = "room"
    extended = {"temperature": float, "capture_time": np.int64, "seed": np.uint64}  # noqa: RUF012

    @dataclass
    class Config:
        mean: float = option(21.0, "of the room", "C")
        times: int = 1
        loud: bool = False
        port: str = "serial"
        folder: Path = Path("here")
        colour: Colour = Colour.RED
        mode: Literal["fast", "slow"] = "slow"
        gains: list[float] = field(default_factory=lambda: [1.0, 2.0])
        offsets: tuple[int, ...] = (1, 2, 3)
        seed: Seed = Seed(0)  # noqa: RUF009

    def __init__(self, config: Config) -> None:
        self.config = config

    def read(self, reading: Reading) -> None:
        config = self.config
        reading.extended["temperature"] = config.mean * config.times + sum(config.gains)
        reading.extended = {"capture_time": reading.time, "seed": config.seed}


class Joint:
    """A joint that lags; fails in the verb that an option names."""

    actuators = ("shoulder", "elbow")
    limits = {"elbow": (-1.0, 1.0)}  # noqa: RUF012
    units = {"State": "rad"}  # noqa: RUF012
    extended = {"halts": np.int32, "resumes": np.int32}  # noqa: RUF012
    requests = {"home": {"place": float}, "calibrate": None}  # noqa: RUF012

    @dataclass
    class Config:
        fails_in: str = ""
        gain: float = 0.5

    def __init__(self, config: Config) -> None:
        self.config = config
        self.place = np.zeros(2)
        self.requested = np.zeros(2)
        self.halts = self.resumes = 0
        self.homing = -1
        self._may_fail("__init__")

    def _may_fail(self, verb: str) -> None:
        if self.config.fails_in == verb:
            raise RuntimeError(f"broken {verb}")

    def start(self) -> None:
        self._may_fail("start")

    def write(self, desired: Desired) -> None:
        if desired.iteration >= 3:
            self._may_fail("write")
        self.requested = np.array(desired.states)
        self.place += self.config.gain * (self.requested - self.place)

    def read(self, reading: Reading) -> None:
        if reading.iteration >= 3:
            self._may_fail("read")
            if self.config.fails_in == "fault":
                reading.fault("the bus is gone")
            if self.config.fails_in == "halting":
                reading.halt("too hot")
            if self.config.fails_in == "finish":
                reading.finish()
            if self.config.fails_in == "interrupt":
                reading.interrupt("elbow")
            if self.config.fails_in == "unknown":
                reading.interrupt("wrist")
        reading.observed = self.place
        reading.extended = {"halts": self.halts, "resumes": self.resumes}
        if self.homing >= 0 and not reading.runs("calibrate"):
            self.homing = -1
        if self.homing >= 0:
            self.homing += 1
            reading.progress("calibrate", f"at {self.homing}")
            if self.homing == 5:
                self.place[:] = 0.25
                reading.ended("calibrate", o80.StartAfresh())

    def on_home(self, fields: Any) -> o80.StartAfresh:
        self._may_fail("on_home")
        if fields.place > 1:
            raise o80.RequestRejected("too far")
        self.place[:] = fields.place
        return o80.StartAfresh()

    def on_calibrate(self, fields: Any) -> o80.Running:
        self.homing = 0
        return o80.Running("begins")

    def halt(self) -> None:
        self.halts += 1
        self._may_fail("halt")

    def resume(self) -> None:
        self.resumes += 1
        if self.config.fails_in == "refuse":
            raise o80.RequestRejected("the bus is down")
        self._may_fail("resume")

    def stop(self) -> None:
        print("stopped", flush=True)
        self._may_fail("stop")


class Obedient:
    """Joints that are where they are told to be."""

    actuators: tuple[str, ...] = ("elbow",)
    simulated = True

    def __init__(self) -> None:
        self.places = np.zeros(len(self.actuators))

    def write(self, desired: Desired) -> None:
        self.places = np.array(desired.states)

    def read(self, reading: Reading) -> None:
        reading.observed = self.places


class Paced:
    """Paces the loop with `wait`."""

    extended = {"due": np.int64}  # noqa: RUF012
    frequency = 250.0

    def __init__(self) -> None:
        self.due = 0

    def wait(self, due: int) -> None:
        self.due = due
        time.sleep(max(0.0, due - time.monotonic_ns()) * 1e-9)

    def read(self, reading: Reading) -> None:
        reading.extended["due"] = self.due


class Spins:
    """Spins in iteration 3 until the thread has lost its real-time priority."""

    extended = {"policy": np.int64}  # noqa: RUF012

    def read(self, reading: Reading) -> None:
        while reading.iteration == 3 and os.sched_getparam(0).sched_priority > 0:
            pass
        reading.extended["policy"] = os.sched_getscheduler(0)


class Hanging:
    """Hangs in the verb that an option names, or is late in each `write`."""

    actuators = ("a",)
    simulated = True

    @dataclass
    class Config:
        verb: str = "none"

    def __init__(self, config: Config) -> None:
        self.verb = config.verb

    def _hang_in(self, verb: str) -> None:
        while self.verb == verb:
            signal.pause()

    def start(self) -> None:
        self._hang_in("start")

    def write(self, desired: Desired) -> None:
        if desired.iteration == 20:
            self._hang_in("write")
        if self.verb == "late":
            time.sleep(0.005)

    def read(self, reading: Reading) -> None: ...


class Silent:
    """Does not say whether it is simulated; is elsewhere after a halt."""

    actuators = ("a",)
    limits = {"a": o80.Limits(speed=2.0)}  # noqa: RUF012
    place = 0.0

    def read(self, reading: Reading) -> None:
        reading.observed[0] = self.place

    def halt(self) -> None:
        self.place = 30.0
