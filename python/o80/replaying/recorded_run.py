"""Run of a backend, as a replay needs it: its rows, its journal, how it was started."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import o80._core as _core
from o80.base.errors import InvalidArgument
from o80.base.machine import Machine, this_machine
from o80.frontend.segments import is_own

if TYPE_CHECKING:
    from o80.frontend.frontend import Frontend
    from o80.recording.reader import RecordingFile
    from o80.recording.recorded_epoch import RecordedEpoch
    from o80.rows.history import History
    from o80.rows.provenance import Provenance

ROWS_AT_ONCE = 1024  # Ctrl-C waits for them
_BYTES_AT_ONCE = 1 << 20


class RecordedRun(Protocol):
    """One run of a backend."""

    @property
    def segment(self) -> str: ...

    @property
    def number(self) -> int:
        """Number of the run in a file, from 0."""

    @property
    def schema(self) -> dict[str, Any]: ...

    @property
    def description(self) -> _core.Description:
        """The same, as the compiled library reads it."""

    @property
    def provenance(self) -> "Provenance": ...

    @property
    def machine(self) -> Machine | None:
        """Machine of the run; None: not known."""

    @property
    def is_own(self) -> bool:
        """It is of a robot of this user, in shared memory; files may come from strangers."""

    @property
    def rows(self) -> int:
        """Number of rows, for a progress bar."""

    @property
    def missing(self) -> list[str]:
        """Texts about an end of the run, or runs before it, that are missing."""

    def blocks(self) -> "Iterator[History]":
        """Rows in their order, a few thousand at a time."""

    def entries(self) -> Iterator[_core.JournalEntry]:
        """The journal in its order, with its entries `at_rest`."""


@dataclass(frozen=True)
class LiveRun:
    """Run that a segment in shared memory holds."""

    frontend: "Frontend"
    number: int = 0

    @property
    def segment(self) -> str:
        return self.frontend.segment

    @property
    def schema(self) -> dict[str, Any]:
        schema: dict[str, Any] = self.frontend._layout.schema
        return schema

    @property
    def description(self) -> _core.Description:
        return self.frontend._description

    @property
    def provenance(self) -> "Provenance":
        return self.frontend.provenance

    @property
    def machine(self) -> Machine:
        return this_machine()

    @property
    def is_own(self) -> bool:
        return is_own(self.frontend)

    @property
    def rows(self) -> int:
        return self.frontend.published + 1 - self.frontend.oldest

    @property
    def missing(self) -> list[str]:
        return []

    def blocks(self) -> "Iterator[History]":
        last = self.frontend.published
        for since in range(self.frontend.oldest, last + 1, ROWS_AT_ONCE):
            yield self.frontend.history(since=since, until=min(last, since + ROWS_AT_ONCE - 1))

    def entries(self) -> Iterator[_core.JournalEntry]:
        # as a recorder does: it tells which entries were overwritten before the first read
        journal = _core.RawJournal(self.frontend, 0)
        if not journal.exists:
            raise InvalidArgument(
                f"'{self.segment}' was started without a journal (journal=0): replay needs it"
            )
        native = _core.RecordedJournal(self.frontend._description, 0, rests=True)
        while content := journal.read(_BYTES_AT_ONCE)[0]:
            yield from native.decode(content, _core.JOURNAL_CODEC)


@dataclass(frozen=True)
class FileRun:
    """An epoch of a recording."""

    segment: str
    number: int
    epoch: "RecordedEpoch"

    @property
    def schema(self) -> dict[str, Any]:
        return self.epoch.schema

    @property
    def description(self) -> _core.Description:
        return self.epoch.description

    @property
    def provenance(self) -> "Provenance":
        return self.epoch.provenance

    @property
    def machine(self) -> Machine | None:
        return self.epoch.machine

    @property
    def is_own(self) -> bool:
        return False

    @property
    def rows(self) -> int:
        return self.epoch.rows

    @property
    def missing(self) -> list[str]:
        return [
            *map(str, filter(None, [self.epoch.interruption])),
            *(str(gap) for gap in self.epoch.gaps if gap.first >= self.epoch.next_row),
        ]

    def blocks(self) -> "Iterator[History]":
        for block in self.epoch.blocks():
            for begin in range(0, len(block), ROWS_AT_ONCE):
                yield block[begin : begin + ROWS_AT_ONCE]

    def entries(self) -> Iterator[_core.JournalEntry]:
        if not self.epoch.has_journal:
            raise InvalidArgument(
                f"the recording has no journal of '{self.segment}', which a replay needs: its "
                f"robot was started without one, or an older o80 recorded it"
            )
        return self.epoch.native_journal(rests=True)


def runs_in(recording: "RecordingFile", segment: str | None = None) -> list[FileRun]:
    """The runs of all segments of a recording, or of one. Raises InvalidArgument."""
    if segment is not None and segment not in recording.segments:
        there = ", ".join(recording) or "none"
        raise InvalidArgument(f"no segment '{segment}' in {recording.path}; there are: {there}")
    names = [segment] if segment is not None else list(recording)
    return [
        FileRun(name, number, epoch)
        for name in names
        for number, epoch in enumerate(recording[name].epochs)
    ]
