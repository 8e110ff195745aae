"""Vicon, OptiTrack and VRPN by the package `motioncapture`, in a supervised child process.

The package's clients block without a timeout, and some ignore Ctrl-C. They therefore run in a
child process, which is killed after a long silence or when the driver stops. There are no time
stamps: the capture time is the arrival minus the option latency, and `stamped` is False.
"""

from __future__ import annotations

import contextlib
import importlib.util
import json
import os
import selectors
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

from o80.base.descriptors import above_standard
from o80.drivers import option
from o80.errors import DriverError, InvalidArgument
from o80_devices.motion_capture.frame import Frame, Subject
from o80_devices.motion_capture.frame_stream import LONGEST_RETRY, SILENCE, FrameStream
from o80_devices.motion_capture.sensor import Sensor, SensorConfig
from o80_devices.motion_capture.watched_child import STARTED

CHILD = "o80_devices.motion_capture.watched_child"
STARTING = 60.0  # timeout of the child's imports, long enough for a busy machine [s]
FIRST = 3.0  # timeout from the imports to the first frame [s]
FOUND = 5.0  # timeout of the first subject, if the user names none [s]
LONGEST_LINE = 1 << 20  # [bytes]


class ChildConnection:
    """Child process that prints frames as lines of JSON."""

    @above_standard()
    def __init__(self, system: str, host: str) -> None:
        self._child = subprocess.Popen(
            [sys.executable, "-m", CHILD, system, host, str(os.getpid())],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            start_new_session=True,  # Ctrl-C reaches the driver, which kills the child
        )
        assert self._child.stdout is not None
        self._pipe = self._child.stdout.fileno()
        os.set_blocking(self._pipe, False)
        self._selector = selectors.DefaultSelector()
        self._selector.register(self._pipe, selectors.EVENT_READ)
        self._buffer = b""
        self._number = 0
        self._begin = time.monotonic()
        self.started_after: float | None = None
        """Duration of the child's imports [s]; None: not finished."""

    @property
    def patience(self) -> float:
        if self.started_after is None:
            return STARTING
        return SILENCE if self._number else self.started_after + FIRST

    def receive(self, timeout: float) -> Frame | None:
        end = time.monotonic() + timeout
        while b"\n" not in self._buffer:
            if not self._selector.select(max(0.0, end - time.monotonic())):
                return None
            got = os.read(self._pipe, 1 << 16)
            if not got:
                raise ConnectionError(f"the client has ended with code {self._child.wait()}")
            self._buffer += got
            if len(self._buffer) > LONGEST_LINE:
                raise ValueError("the client printed something that is not a frame")
        line, _, self._buffer = self._buffer.partition(b"\n")
        return self._frame(line)

    def _frame(self, line: bytes) -> Frame | None:
        """Parses a frame; None without a subject, because the connection may be silent."""
        if line == STARTED:
            self.started_after = time.monotonic() - self._begin
            return None
        arrival, bodies = json.loads(line)
        if not bodies:
            return None
        self._number += 1
        subjects = {
            name: subject_of(tuple(position), tuple(quaternion))
            for name, (position, quaternion) in bodies.items()
        }
        return Frame(self._number, None, arrival, subjects)

    def close(self) -> None:
        self._selector.close()
        with contextlib.suppress(ProcessLookupError):
            self._child.kill()
        self._child.wait()
        if self._child.stdout is not None:
            self._child.stdout.close()


def subject_of(position: tuple[float, ...], quaternion: tuple[float, ...]) -> Subject:
    """Builds a subject; some clients mark an unseen one by NaN or a zero quaternion."""
    seen = None not in position + quaternion and any(quaternion)  # NaN is null in JSON
    return Subject(True, position, quaternion) if seen else Subject(False)


class WatchedFrames(FrameStream):
    """Frames of the child process, which is restarted after silence or death."""

    tick = 1.0

    def __init__(self, system: str, host: str) -> None:
        super().__init__(
            lambda: ChildConnection(system, host), f"{system} at {host}", LONGEST_RETRY
        )
        self._system = system
        self._host = host

    @cached_property
    def names(self) -> Sequence[str]:
        """Names of the first frame's subjects. Raises DriverError if none arrives."""
        connection = ChildConnection(self._system, self._host)
        begin = time.monotonic()
        try:
            while time.monotonic() - begin < FOUND + (connection.started_after or STARTING):
                frame = connection.receive(0.1)
                if frame is not None:
                    return sorted(frame.subjects)
            trouble = f"no subject within {FOUND:g} s"
        except (OSError, ValueError) as error:
            trouble = str(error)
        finally:
            connection.close()
        raise DriverError(
            f"the {self._system} system at {self._host} has no subjects: {trouble}. Start it, "
            "correct --host, or name the subjects with --subjects"
        )


class Watched(Sensor):
    """`o80 run o80_devices.motion_capture:Watched --system vicon --host 10.0.0.2`."""

    name = "motion_capture"

    @dataclass
    class Config(SensorConfig):
        system: Literal["vicon", "optitrack", "vrpn", "qualisys", "mock"] = option(
            "vicon", "its kind"
        )
        host: str = option("127.0.0.1", "of the system")

    def __init__(self, config: Config) -> None:
        if importlib.util.find_spec("motioncapture") is None:
            raise InvalidArgument(
                "the package motioncapture is not installed: "
                "pip install 'o80-devices[motioncapture]'"
            )
        super().__init__(config, WatchedFrames(config.system, config.host))
