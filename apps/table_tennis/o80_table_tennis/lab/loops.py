"""How the loop of a process keeps its rate, as its segment and the kernel say."""

from __future__ import annotations

import os
from dataclasses import dataclass, replace

import o80

from .processes import Part
from .watched import Watched

CLASSES = {os.SCHED_OTHER: "other", os.SCHED_FIFO: "fifo", os.SCHED_RR: "rr"}


@dataclass(frozen=True)
class Loop:
    """Since the start of a process, or since an earlier look."""

    rate: float | None
    """Over the last second [1/s]; None: it bursts."""
    iterations: int
    late: int
    missed: int
    """Periods that were skipped."""
    scheduling: str
    """Class and priority of its loop."""

    @property
    def missed_percent(self) -> float:
        """Share of the periods that were skipped [%]."""
        return 100.0 * self.missed / max(1, self.iterations + self.missed)

    def since(self, earlier: Loop | None) -> Loop:
        """Counts since an earlier look at the same process; None: all."""
        if earlier is None or earlier.iterations > self.iterations:  # it was started again
            return self
        return replace(
            self,
            iterations=self.iterations - earlier.iterations,
            late=self.late - earlier.late,
            missed=self.missed - earlier.missed,
        )


def loop_of(observer: Watched, part: Part) -> Loop | None:
    """Figures of the loop of a part; None: it does not run."""
    frontend = observer.frontend()
    if frontend is None:
        return None
    pids = [each.pid for each in o80.segments() if each.name == part.segment]
    return Loop(
        frontend.rate_reached,
        frontend.published,
        frontend.overruns,
        frontend.missed_ticks,
        scheduling_of(pids[0]) if pids else "",
    )


def scheduling_of(pid: int) -> str:
    """Scheduling of the main thread of a process, which runs its loop."""
    try:
        kind = os.sched_getscheduler(pid)
        priority = os.sched_getparam(pid).sched_priority
    except OSError:
        return ""
    return CLASSES.get(kind, str(kind)) + (f" {priority}" if priority else "")
