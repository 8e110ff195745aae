"""The segments there are on this computer."""

from dataclasses import dataclass

from o80 import _core


@dataclass(frozen=True, kw_only=True)
class Segment:
    """What stands in shared memory under one name."""

    name: str
    life: str  #: starting, running, stopped, failed, superseded or killed
    readable: bool  #: False: made by another version, or not ours to read or to trust
    pid: int
    process_start: int  #: tells its process from a later one of the same pid
    user: str
    program: str
    started_at: int  #: [s] since 1970
    bytes: int
    epoch: int  #: names this run of the backend
    problem: str = ""  #: why it is not readable

    @property
    def alive(self) -> bool:
        """Whether its backend lives."""
        return self.life in ("starting", "running")


def segments() -> list[Segment]:
    """All segments, by name, living and dead."""
    return [
        Segment(
            name=entry.name,
            life=entry.life,
            readable=entry.readable,
            pid=entry.pid,
            process_start=entry.process_start,
            user=entry.user,
            program=entry.program,
            started_at=entry.started_at,
            bytes=entry.size,
            epoch=entry.epoch,
            problem=entry.problem,
        )
        for entry in _core.list_segments()
    ]


def clean(name: str | None = None) -> list[str]:
    """Removes a dead segment (None: all of them) and gives the names of those removed.

    Raises SegmentTaken if the backend of that name lives.
    """
    if name is None:
        return _core.clean_dead()
    return [name] if _core.clean(name) else []
