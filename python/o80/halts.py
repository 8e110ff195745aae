"""The halt of a backend: a latched stop that anybody who may command can ask for."""

from dataclasses import dataclass

from o80 import _core


@dataclass(frozen=True)
class Halt:
    """Why a backend is halted."""

    number: int  #: what `Frontend.resume` names
    cause: str  #: frontend, driver, silence, dead_frontend, error, overruns or predecessor
    iteration: int | None  #: in which it began to act; None if it was asked for a moment ago
    who: str  #: the process that asked for it; empty if the backend did
    text: str  #: the reason in words


def halt(segment: str, reason: str = "", timeout: float | None = 0.0) -> int:
    """Halts the backend of a segment, also one that is still starting; the number of the halt.

    timeout: how long to wait for a backend [s]. Raises TimeoutError, SegmentError, BackendGone.
    """
    return _core.halt(segment, reason, timeout)
