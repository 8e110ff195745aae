"""Common parts of the motion capture drivers: rows, capture times and gaps."""

from __future__ import annotations

import difflib
import re
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from o80.base.screen import complain
from o80.drivers import Desired, Reading, option
from o80.errors import InvalidArgument
from o80_devices.clock import ClockMap
from o80_devices.frame_pace import FramePace
from o80_devices.motion_capture.frame import Frame, Subject
from o80_devices.motion_capture.transform import Transform

SECOND = 1_000_000_000  # [ns]
FRAMES_UNTIL_REPORT = 50  # frames without a subject before a warning


class Reason(IntEnum):
    """Reason why a row has no poses, or SEEN."""

    SEEN = 0
    NO_NEW_FRAME = 1  #: no frame since the last row; the next one is not late yet
    SILENT = 2  #: connected, but no frame for longer than the option silent_after
    CONNECTING = 3
    DISCONNECTED = 4  #: refused, closed by the server, or the process died
    ENDED = 5  #: end of a recording


class Frames(Protocol):
    """Source of frames."""

    @property
    def names(self) -> Sequence[str]:
        """Names of all known subjects; read before `start` if the user names none."""

    @property
    def tick(self) -> float:
        """Unit of a stamp [ns]."""

    @property
    def reason(self) -> Reason:
        """Reason why there is no frame now."""

    def start(self) -> None: ...

    def stop(self) -> None: ...

    def taken(self, now: int) -> Frame | None:
        """Pops the oldest arrived frame, or None. now: [ns] on the clock of the rows."""

    def next(self, deadline: int) -> Frame | None:
        """Waits for the next frame until `deadline` (monotonic) [ns]; None: none arrived."""


@dataclass
class SensorConfig:
    subjects: str = option("", "names, separated by commas; empty: those that the system knows")
    transform: str = option("", "file with the transform from the system to the world")
    latency: float = option(0.0, "from capture to arrival, added to what the system reports", "s")
    latency_error: float = option(0.0, "of this latency", "s")
    silent_after: float = option(0.08, "without a frame, after which rows say why", "s")


class Sensor:
    """Driver of a motion capture system."""

    units = {  # noqa: RUF012
        "capture_time": "ns",
        "capture_error": "ns",
        "position": "m",
    }

    def __init__(self, config: SensorConfig, frames: Frames) -> None:
        if not config.silent_after > 0:
            raise InvalidArgument(f"silent_after must be positive, got {config.silent_after}")
        self._config = config
        self._frames = frames
        self._world = Transform.load(Path(config.transform)) if config.transform else None
        self._waited: Frame | None = None
        self._has_waited = False
        self._pace = FramePace()
        self._last_seen: int | None = None  # [ns] on the clock of the rows
        self._last_number: int | None = None
        self._lost = 0
        self._connection = 0
        self._frames_checked = 0
        self._there: set[str] = set()

    @cached_property
    def subjects(self) -> dict[str, str]:
        """Field of each subject. Raises InvalidArgument without subjects, or for equal fields."""
        given = [name.strip() for name in self._config.subjects.split(",")]
        names = [name for name in given if name] or list(self._frames.names)
        found: dict[str, str] = {}
        for name in names:
            field = field_name(name)
            if field in found.values() or field in FRAME_FIELDS:
                raise InvalidArgument(
                    f"the subject '{name}' would be the field '{field}', which exists already: "
                    "rename it in the motion capture system"
                )
            found[name] = field
        if not found:
            raise InvalidArgument(
                "the motion capture system knows no subject: name them with --subjects A,B"
            )
        return found

    @property
    def extended(self) -> dict[str, Any]:
        return FRAME_FIELDS | dict.fromkeys(self.subjects.values(), SUBJECT_FIELDS)

    # ------------------------------------------------------------------ verbs

    def start(self) -> None:
        config = self._config
        self._clock = ClockMap(
            tick=self._frames.tick, latency=config.latency, latency_error=config.latency_error
        )
        self._frames.start()

    def write(self, desired: Desired) -> None:
        self._pace.period = round(desired.period * SECOND)

    def wait(self, due: int) -> None:
        self._has_waited = True
        self._pace.wait(due, self._frame_arrives)

    def _frame_arrives(self, deadline: int) -> bool:
        self._waited = self._frames.next(deadline)
        return self._waited is not None

    def read(self, reading: Reading) -> None:
        if self._last_seen is None:
            self._last_seen = reading.time
        frame = self._waited if self._has_waited else self._frames.taken(reading.time)
        self._waited, self._has_waited = None, False
        if frame is not None and self._fill(frame, reading):
            self._last_seen = reading.time
        else:
            reason = self._why_none(reading.time)
            reading.extended = NO_FRAME | {"reason": reason}
            reading.extended = dict.fromkeys(self.subjects.values(), UNSEEN)

    def stop(self) -> None:
        self._frames.stop()

    # ------------------------------------------------------------------ rows

    def _fill(self, frame: Frame, reading: Reading) -> bool:
        """Fills the row; returns False for a frame older than the last one."""
        arrival = frame.arrival - frame.latency
        if frame.stamp is None:
            capture_time = arrival - round(self._config.latency * SECOND)
            error, epoch = round(self._config.latency_error * SECOND), 0
        else:
            if frame.connection != self._connection:
                self._clock.restarted()
                self._connection = frame.connection
            capture = self._clock.capture(frame.stamp, arrival)
            if capture is None:
                return False
            capture_time, error, epoch = capture.time, capture.error, capture.epoch
        self._count_lost(frame.number)
        self._report_unknown(frame)
        reading.extended = {
            "reason": Reason.SEEN,
            "capture_time": capture_time,
            "capture_error": error,
            "stamp": frame.stamp or 0,
            "stamped": frame.stamp is not None,
            "epoch": epoch,
            "frame_number": frame.number,
            "lost_frames": self._lost,
        }
        for name, field in self.subjects.items():
            reading.extended[field] = self._row_of(frame.subjects.get(name))
        return True

    def _row_of(self, subject: Subject | None) -> tuple[Any, ...]:
        if subject is None or not subject.visible:
            return UNSEEN
        position, quaternion = subject.position, subject.quaternion
        if self._world is not None:
            position, quaternion = self._world.of_pose(position, quaternion)
        return True, position, quaternion, subject.quality

    def _count_lost(self, number: int) -> None:
        if self._last_number is not None and number > self._last_number:
            self._lost += number - self._last_number - 1
        self._last_number = number

    def _report_unknown(self, frame: Frame) -> None:
        """Reports once all subjects without a frame: their names may be misspelled."""
        if self._frames_checked >= FRAMES_UNTIL_REPORT:
            return
        self._frames_checked += 1
        self._there |= frame.subjects.keys()
        if self._frames_checked < FRAMES_UNTIL_REPORT:
            return
        for name in self.subjects.keys() - self._there:
            complain(hint(name, sorted(self._there)))

    def _why_none(self, now: int) -> Reason:
        reason = self._frames.reason
        if reason is not Reason.SEEN:
            return reason
        silence = now - (self._last_seen or 0)
        return (
            Reason.SILENT if silence > self._config.silent_after * SECOND else Reason.NO_NEW_FRAME
        )


FRAME_FIELDS: dict[str, Any] = {
    "reason": Reason,
    "capture_time": np.int64,
    "capture_error": np.int64,
    "stamp": np.int64,
    "stamped": bool,
    "epoch": np.int32,
    "frame_number": np.int64,
    "lost_frames": np.int64,
}
NO_FRAME = {
    "capture_time": 0,
    "capture_error": 0,
    "stamp": 0,
    "stamped": False,
    "frame_number": 0,
}
"""Values of a row without a frame; `epoch` and `lost_frames` keep their values."""
SUBJECT_FIELDS: dict[str, Any] = {
    "visible": bool,
    "position": (float, 3),
    "quaternion": (float, 4),
    "quality": float,
}
UNSEEN = (False, Subject(False).position, Subject(False).quaternion, float("nan"))


def hint(name: str, there: Sequence[str]) -> str:
    """Builds the hint about a subject that is in no frame."""
    near = difflib.get_close_matches(name, there, n=1)
    listed = ", ".join(there[:5]) + (", ..." if len(there) > 5 else "")
    known = f"did you mean '{near[0]}'?" if near else f"there are: {listed or 'none'}"
    return f"no frame so far has the subject '{name}': it is covered, or misspelled; {known}"


def field_name(subject: str) -> str:
    """Converts a subject name to a field name: "TT Platte 1" to TT_Platte_1."""
    name = re.sub(r"[^0-9A-Za-z_]+", "_", subject).strip("_")
    return f"subject_{name}" if not name or name[0].isdigit() else name
