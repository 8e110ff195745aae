"""Reads the file format of the experiment's Vicon client."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from pathlib import Path

from o80.errors import InvalidArgument
from o80_devices.motion_capture.frame import Frame, Subject

COUNT = struct.Struct("<Q")
HEADER = struct.Struct("<iiddqQ")  # format, number, rate, latency, time stamp, subjects
VALUES = struct.Struct("<?8d")  # visible; quaternion x y z w, position; quality
FORMAT = 4
MAX_SUBJECTS = 10_000
MIN_RATE, MAX_RATE = 1e-3, 1e6  # valid range [Hz]


@dataclass(frozen=True)
class RecordedFrames:
    frames: list[Frame]  #: arrival: [ns] since the epoch of the wall clock
    rate: float  #: [Hz]

    @property
    def names(self) -> list[str]:
        """Names of all subjects, in order of first appearance."""
        return list(dict.fromkeys(name for frame in self.frames for name in frame.subjects))


def load(file: Path) -> RecordedFrames:
    """Reads a file of frames. Raises InvalidArgument if the file is no recording."""
    try:
        content = file.read_bytes()
    except OSError as error:
        raise InvalidArgument(f"{file} cannot be read: {error.strerror}") from error
    frames = []
    try:
        (count,) = COUNT.unpack_from(content)
        place, rate = COUNT.size, 0.0
        for _ in range(count):
            frame, rate, place = _frame(content, place)
            frames.append(frame)
    except (struct.error, ValueError, OverflowError) as error:
        raise InvalidArgument(
            f"{file} is not a recording of motion capture, or is cut after frame {len(frames)}: "
            f"{error}"
        ) from error
    if not frames or not MIN_RATE < rate < MAX_RATE:
        raise InvalidArgument(f"{file} holds no frame with a rate")
    return RecordedFrames(frames, rate)


def _frame(content: bytes, place: int) -> tuple[Frame, float, int]:
    version, number, rate, latency, stamp, subjects = HEADER.unpack_from(content, place)
    if version != FORMAT or subjects > MAX_SUBJECTS:
        raise ValueError(f"format {version} with {subjects} subjects, expected format {FORMAT}")
    place += HEADER.size
    found = {}
    for _ in range(subjects):
        (length,) = COUNT.unpack_from(content, place)
        place += COUNT.size
        name = content[place : place + length].decode()
        place += length
        visible, *values = VALUES.unpack_from(content, place)
        place += VALUES.size
        quaternion, position, quality = values[:4], values[4:7], values[7]
        found[name] = (
            Subject(True, tuple(position), tuple(quaternion), quality)
            if visible
            else Subject(False)
        )
    return Frame(number, number, stamp, found, round(latency * 1e9)), rate, place
