"""The segments on this computer."""

import os
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

import o80._core as _core

if TYPE_CHECKING:
    from o80.frontend.reader import Reader


@dataclass(frozen=True, kw_only=True)
class Segment:
    """One segment in shared memory."""

    name: str
    life: str  #: starting, running, stopped, failed, superseded, killed; unknown if not readable
    readable: bool  #: False: of another version, or this user may not read or trust it
    pid: int
    process_start: int  #: distinguishes its process from a later one with the same pid
    user: str
    program: str
    started_at: int  #: [s] since 1970
    bytes: int
    epoch: int  #: identifies this run of the backend
    state: str = "unknown"  #: life, or halted or played while it runs, as in texts
    played: bool = False  #: a recording is played into it: it takes no commands
    problem: str = ""  #: reason why it is not readable

    @property
    def alive(self) -> bool:
        """True while its backend runs or starts; False also if that is unknown."""
        return self.life in ("starting", "running")


class Segments(list[Segment]):
    """Segments; a notebook shows them like `o80 list`."""

    def _repr_html_(self) -> str:
        from o80.base.screen import html  # late: most processes show no table

        return html(
            ("segment", "state", "program", "pid", "user", ""),
            [
                (each.name, each.state, each.program, each.pid or "", each.user, each.problem)
                for each in self
            ],
        )


def segments() -> list[Segment]:
    """Lists all segments, alive and dead, sorted by name."""
    names = [field.name for field in fields(Segment) if field.name != "bytes"]
    return Segments(
        Segment(bytes=entry.size, **{name: getattr(entry, name) for name in names})
        for entry in _core.list_segments()
    )


def clean(name: str | None = None) -> list[str]:
    """Removes a dead segment (None: all dead ones) and returns the names of the removed segments.

    Raises SegmentTaken if the backend of that segment is alive.
    """
    if name is None:
        return _core.clean_dead()
    return [name] if _core.clean(name) else []


def boot_of(frontend: "Reader") -> str:
    """Returns the id of the boot whose clock the rows use; empty: unknown, simulated or played."""
    from o80.base.machine import this_boot  # late: `o80 list` does not need it

    real_time = frontend.schema["clock"] == "monotonic" and not frontend.played
    return this_boot() if real_time else ""


def is_own(frontend: "Reader") -> bool:
    """True for a segment of a robot that this user runs, or ran.

    False for a played recording, which may come from a stranger, and for a robot of another user.
    """
    if frontend.played:
        return False
    import pwd

    try:
        user = pwd.getpwuid(os.geteuid()).pw_name
    except KeyError:
        user = str(os.geteuid())
    return any(each.name == frontend.segment and each.user == user for each in segments())
