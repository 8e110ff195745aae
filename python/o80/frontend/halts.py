"""The halt of a backend: every commander can request it, and it stays until it is resumed."""

from dataclasses import dataclass

import o80._core as _core


@dataclass(frozen=True)
class Halt:
    """A halt that is in force, or requested."""

    number: int  #: argument of `Frontend.resume`
    cause: str  #: frontend, driver, silence, dead_frontend, error, overruns or predecessor
    iteration: int | None  #: in which it began; None if it is requested and not yet in force
    who: str  #: the process that requested it; empty if the backend did
    text: str  #: the reason in words


def halt(segment: str, reason: str = "", timeout: float | None = 0.0) -> int:
    """Halts the backend of a segment, also one that is still starting; returns the halt's number.

    timeout: how long to wait for the backend [s]. Raises TimeoutError, SegmentError, BackendGone.
    """
    return _core.halt(segment, reason, timeout)
