"""Histories for commands that take a running robot or a recording."""

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

from o80.base.errors import BackendGone
from o80.cli.attach import attach
from o80.frontend.segments import boot_of
from o80.recording.epoch import OVERWRITTEN, Gap, Interruption
from o80.rows.history import History
from o80.rows.journal import JournalEntry, marks_in


@dataclass(frozen=True)
class Named:
    """Rows of one run of a robot."""

    name: str  #: name of the segment
    number: int  #: index of the run, among the runs of the segment in one file
    history: History
    wall_offset: int | None  #: wall clock minus row time [ns]; None: not known
    boot: str  #: id of the boot on whose clock the rows are; empty: not known
    journal: Callable[[], list[JournalEntry]]  #: reads the known decisions of the backend
    marks: list[tuple[str, int]] = field(default_factory=list)  #: name and iteration
    gaps: Callable[[], list[Gap]] = list  #: finds the missing rows
    interruption: Interruption | None = None

    @property
    def title(self) -> str:
        """Name of the segment, followed by the number of the run if that is not 0."""
        return f"{self.name}/{self.number}" if self.number else self.name


def histories(source: str, only: str | None, *, seconds: float | None = None) -> Iterator[Named]:
    """Yields the histories of a file, or of a segment in shared memory.

    source: a path that ends in .mcap, or the name of a segment. only: one segment of a file.
    """
    if not source.endswith(".mcap"):
        with attach(source) as frontend:
            if frontend.published < 0:
                raise BackendGone(f"segment '{source}' has no row")
            history = frontend.history(seconds=seconds)
            real_time = frontend.schema["clock"] == "monotonic"
            offset = time.time_ns() - time.monotonic_ns() if real_time else None
            entries = frontend.journal()
            oldest = int(history.iteration[0])
            gaps = [Gap(0, oldest - 1, OVERWRITTEN)] if oldest > 0 and seconds is None else []
            yield Named(
                source,
                0,
                history,
                offset,
                boot_of(frontend),
                lambda: entries,
                marks_in(entries),
                lambda: gaps,
            )
        return
    from o80.recording.reader import open as open_recording

    recording = open_recording(Path(source))
    for name in recording.chosen(None if only is None else [only]):
        epochs, of_run = recording[name].epochs, recording.marks_by_run(name)
        for number, epoch in enumerate(epochs):
            history, journal = epoch.history(seconds=seconds), epoch.journal
            if seconds is not None and len(history):
                journal = partial(epoch.journal_since_row, int(history.iteration[0]))
            yield Named(
                name,
                number,
                history,
                epoch.wall_offset,
                epoch.boot,
                journal,
                [(mark.name, mark.rows[name]) for mark in of_run[number]],
                partial(getattr, epoch, "gaps"),
                epoch.interruption,
            )
