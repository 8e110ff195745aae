"""Frame: measurements of a motion capture system at one moment."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

NOWHERE = (float("nan"),) * 3
NO_ROTATION = (float("nan"),) * 4


@dataclass(frozen=True)
class Subject:
    """The pose of a rigid body."""

    visible: bool
    position: tuple[float, ...] = NOWHERE  #: [m]
    quaternion: tuple[float, ...] = NO_ROTATION  #: x, y, z, w
    quality: float = float("nan")  #: residual, as the system defines it; NaN: none


@dataclass(frozen=True)
class Frame:
    number: int
    stamp: int | None  #: stamp of the device's clock [ticks]; None: none
    arrival: int  #: [ns] on the monotonic clock of this machine
    subjects: Mapping[str, Subject]
    latency: int = 0  #: delay from capture to arrival, as reported by the device [ns]
    connection: int = 0  #: increases when the device may have restarted
