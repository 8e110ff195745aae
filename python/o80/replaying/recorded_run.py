"""Sources of a replay: rows, journal and provenance of a run, in memory or in a file."""

from collections.abc import Iterator
from typing import TYPE_CHECKING

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

ROWS_AT_ONCE = 1024  # Ctrl-C is handled between two such blocks
_BYTES_AT_ONCE = 1 << 20


class LiveRun:
    """Reads a run from a segment in shared memory."""

    number = 0  #: index of the run in a file

    def __init__(self, frontend: "Frontend") -> None:
        self._frontend = frontend
        self.segment, self.schema = frontend.segment, frontend.schema
        self.description = frontend._description  #: the schema, as the compiled library reads it
        self.provenance = frontend.provenance
        self.machine = this_machine()  #: the computer that ran it
        self.is_own = is_own(frontend)  #: a robot of this user ran it, as a file cannot prove
        self.rows = frontend.published + 1 - frontend.oldest  #: number of rows, for a progress bar
        #: texts about missing parts: the end of this run, or runs before it
        self.missing: list[str] = []

    def blocks(self) -> "Iterator[History]":
        """Yields all rows in order, in blocks of at most `ROWS_AT_ONCE`."""
        last = self._frontend.published
        for since in range(self._frontend.oldest, last + 1, ROWS_AT_ONCE):
            yield self._frontend.history(since=since, until=min(last, since + ROWS_AT_ONCE - 1))

    def entries(self) -> Iterator[_core.JournalEntry]:
        """Yields the entries of the journal in order, the `at_rest` entries included."""
        # read as a recorder reads it, which reports the entries overwritten before the first read
        journal = _core.RawJournal(self._frontend, 0)
        if not journal.exists:
            raise InvalidArgument(
                f"'{self.segment}' was started without a journal (journal=0): replay needs it"
            )
        native = _core.RecordedJournal(self.description, 0, rests=True)
        while content := journal.read(_BYTES_AT_ONCE)[0]:
            yield from native.decode(content, _core.JOURNAL_CODEC)


class FileRun:
    """Reads a run from a recording; has the members of LiveRun."""

    is_own = False

    def __init__(self, segment: str, number: int, epoch: "RecordedEpoch") -> None:
        self.segment, self.number, self.epoch = segment, number, epoch
        self.schema, self.description = epoch.schema, epoch.description
        self.rows = epoch.rows

    @property
    def provenance(self) -> "Provenance":
        return self.epoch.provenance

    @property
    def machine(self) -> "Machine":
        return self.epoch.machine

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
                f"robot was started without one"
            )
        return self.epoch.native_journal(rests=True)


RecordedRun = LiveRun | FileRun


def runs_in(recording: "RecordingFile", segment: str | None = None) -> list[FileRun]:
    """Returns the runs of all segments, or of one. Raises InvalidArgument if that is unknown."""
    return [FileRun(*run) for run in recording.runs(None if segment is None else [segment])]
