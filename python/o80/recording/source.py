"""Reads one recorded segment: rows and journal in order, across restarts of its backend."""

from collections.abc import Mapping
from dataclasses import replace
from time import monotonic, time_ns

import o80._core as _core
from o80.base.errors import BackendGone, RecordingError, SegmentError, TimeoutError
from o80.frontend.frontend import Frontend
from o80.recording.blocks import Block
from o80.recording.epoch import EARLIER_FILE, GAP, WallClock, note_of
from o80.recording.file_writer import FileWriter
from o80.recording.journal_channel import GAP as JOURNAL_GAP
from o80.recording.journal_channel import JournalRecorder, codec_of
from o80.recording.log_channel import ERROR, INFO, JournalLog, Line
from o80.recording.output import Written
from o80.recording.row_writer import RowWriter
from o80.recording.snapshots import SnapshotRequests

LARGEST_BLOCK = 4 << 20  # largest size of the rows of one read [bytes]
BETWEEN_ATTEMPTS = 0.05  # time between two attempts to attach to an absent backend [s]


class Source:
    """Reads rows and journal of a segment by name. For one thread."""

    def __init__(
        self,
        name: str,
        file: FileWriter,
        written: Mapping[int, Written],
        clock: WallClock,
        *,
        from_now: bool,
        snapshots: float | None = None,
    ) -> None:
        """written: by epoch, at least the newest. clock: of the recording. from_now: begin with
        the newest row. snapshots: interval of snapshot requests [s].
        """
        self.name = name
        self.rows = 0  #: rows recorded so far
        self.missed = 0  #: rows overwritten before they were read
        self.behind = 0  #: rows published but unread at the last poll
        #: Marks of frontends that were read and not written yet: text and iteration.
        self.marks: list[tuple[str, int]] = []
        self.log: list[Line] = []  #: lines that were not written yet
        self._file = file
        self._written = dict(written)
        self._clock = clock
        self._from_now = from_now
        self.frontend: Frontend | None = None  #: of the current backend
        self._writer: RowWriter | None = None
        self._journal: JournalRecorder | None = None
        self._journal_log: JournalLog | None = None
        self._end_noted = False
        self._was_interrupted = bool(written)
        self._snapshots = None if snapshots is None else SnapshotRequests(snapshots)
        self._next = 0
        self._last_log_time = max((each.last_log_time for each in written.values()), default=0)
        self._attempt_at = 0.0
        self._attach()  # recording begins now
        self._from_now = False  # a robot that starts later is recorded from its first row

    @property
    def position(self) -> tuple[int, int]:
        """Epoch and iteration of the newest row; -1: none."""
        return (-1 if self.frontend is None else self.frontend.epoch), self.newest

    def has_read(self, position: tuple[int, int]) -> bool:
        """True if the row at an earlier `position` and the decisions up to it were read.

        True also if they were lost with their backend.
        """
        epoch, iteration = position
        drained = self._journal is None or self._journal.drained
        return self.position[0] != epoch or (self._next > iteration and drained)

    @property
    def newest(self) -> int:
        """Iteration of the newest row; -1: there is none."""
        return -1 if self.frontend is None else self.frontend.published

    @property
    def begin(self) -> int:
        """First row of this run in the recording; -1: no run."""
        return -1 if self.frontend is None else self._written[self.frontend.epoch].note.begin

    @property
    def continues_at(self) -> int | None:
        """First row of this recorder in a run of an earlier recorder; None: no such run."""
        if self._writer is None or self._writer.note.before != EARLIER_FILE:
            return None
        return self._writer.note.begin

    @property
    def journal_begin(self) -> int | None:
        """Number of the first decision of this run that was read; None: there is no journal."""
        return None if self._journal is None else self._journal.begin

    def close(self) -> None:
        """Detaches from the backend."""
        if self._snapshots is not None:
            self._snapshots.close()
        if self.frontend is not None:
            self.frontend.close()
            self.frontend = None

    def is_filled(self, share: float) -> bool:
        """True if this share of a ring is unread, or a new backend may have started."""
        frontend = self.frontend
        if frontend is None or not frontend.alive:
            return True
        newest = frontend.published
        if newest + 1 - self._next >= share * (newest + 1 - frontend.oldest):
            return newest >= self._next
        return self._journal is not None and self._journal.unread >= share

    def poll(self) -> list[Block]:
        """Returns rows and decisions since the last call; rows of at most LARGEST_BLOCK bytes."""
        if self.frontend is None and not self._attach():
            return []
        assert self.frontend is not None
        blocks = self._read(self.frontend)
        if self._snapshots is not None:
            self._snapshots.poll(self.frontend)
        if not self.frontend.alive:
            blocks = blocks or self._read(self.frontend)  # rows published just before its end
            if self.has_read(self.position):
                self._note_end(self.frontend)
            if not blocks and self._attach():
                blocks = self._read(self.frontend)
        return blocks

    def _read(self, frontend: Frontend) -> list[Block]:
        """Reads rows, then the journal, so that it has the decisions of all these rows."""
        blocks = self._read_rows(frontend)
        journal = self._read_journal()
        return blocks if journal is None else [*blocks, journal]

    # ------------------------------------------------------------------ which backend

    def _attach(self) -> bool:
        """Attaches to a backend other than the one that was read; False if there is none."""
        now = monotonic()
        if now < self._attempt_at:
            return False
        self._attempt_at = now + BETWEEN_ATTEMPTS
        try:
            found = Frontend(self.name, timeout=0, read_only=True, dead=True)
        except (TimeoutError, SegmentError, BackendGone):
            return False
        if found.published < 0 or (self.frontend and found.epoch == self.frontend.epoch):
            found.close()
            return False
        self.close()
        self._begin(found)
        return True

    def _begin(self, frontend: Frontend) -> None:
        self.frontend = frontend
        known = self._written.get(frontend.epoch)
        if known is None:
            known = self._first_time(frontend)
            self._written[frontend.epoch] = known
        self._next = max(known.last + 1, known.note.begin)
        note = replace(known.note, begin=self._next)
        if known.last >= 0:
            note = replace(note, before=EARLIER_FILE)
        self._writer = RowWriter(self._file, frontend, note, known.channel, known.joints)
        self._refuse_other_format(known)
        journal = JournalRecorder(frontend, known.journal, known.journal_next)
        self._journal = journal if journal.exists else None
        if self._journal is not None:
            self._journal_log = JournalLog(frontend)
            if known.journal is None:
                self._journal.add_channel(self._file, note)
        self._end_noted = False
        if self._was_interrupted and known.last < 0:  # runs may be missing in between
            texts = note.run_texts() | {"since": str(self._last_log_time)}
            self._file.add_metadata(note.record("interruption"), texts)
        self._was_interrupted = False
        if known.channel is None:
            self._note(
                self._next, INFO, f"run {note.number} of {note.robot} is recorded from here on"
            )

    def _refuse_other_format(self, known: Written) -> None:
        """Raises RecordingError if the journal was begun in another format."""
        if known.journal is None:
            return
        codec = codec_of(self._file.found, known.journal)
        if codec != _core.JOURNAL_CODEC:
            raise RecordingError(
                f"{self._file.path}: another o80 has begun the journal of '{self.name}' (format "
                f"{codec}, this o80 writes {_core.JOURNAL_CODEC}): record to another file"
            )

    def continue_in(self, file: FileWriter) -> None:
        """Writes all further rows and entries into another file."""
        self._file = file
        if self.frontend is None or self._writer is None:
            return
        note = replace(self._writer.note, begin=self._next, before=EARLIER_FILE)
        self._writer = RowWriter(file, self.frontend, note)
        if self._journal is not None:
            self._journal.add_channel(file, note)

    def _first_time(self, frontend: Frontend) -> Written:
        """Makes the note of an epoch that is not in the recording yet."""
        first = frontend.published
        if not self._from_now or self._written:
            first = min(first, _oldest_safe(frontend))
        number = 1 + max((each.note.number for each in self._written.values()), default=-1)
        times = frontend.history(since=first, until=first).time
        first_time = int(times[0]) if len(times) else 2**62  # the row was overwritten meanwhile
        note = note_of(frontend, number, first)
        return Written(self._clock.placed(note, first_time, self._last_log_time))

    # ------------------------------------------------------------------ what it reads

    def _read_rows(self, frontend: Frontend) -> list[Block]:
        assert self._writer is not None
        newest = frontend.published
        if newest < self._next:
            self.behind = 0
            return []
        most = max(1, LARGEST_BLOCK // frontend._layout.size)
        last = min(newest, self._next + most - 1)
        rows = frontend.history(since=self._next, until=last).rows
        if not len(rows):  # all of them were overwritten meanwhile
            return []
        first, last = int(rows["iteration"][0]), int(rows["iteration"][-1])
        if first > self._next:
            self.missed += first - self._next
            self._note_gap(GAP, self._next, first - 1)
        self._next = last + 1
        self.rows += len(rows)
        self.behind = newest - last
        blocks = self._writer.blocks(rows)
        self._last_log_time = int(blocks[0].log_times[-1])
        return blocks

    def _read_journal(self) -> Block | None:
        if self._journal is None:
            return None
        entries, gap = self._journal.read()
        if gap is not None:
            self._note_gap(JOURNAL_GAP, *gap)
        self.marks += self._journal.marks
        if entries is None:
            return None
        assert self._journal.channel is not None
        assert self._journal_log is not None
        for iteration, level, text in self._journal_log.lines(entries, self._journal.notable):
            self._note(iteration, level, text)
        time = self._last_log_time or time_ns()
        return Block.of(self._journal.channel, [(time, entries.message())])

    def _note_end(self, frontend: Frontend) -> None:
        """Records the end of a run: a killed backend could not write it into the journal."""
        if self._end_noted or self._writer is None:
            return
        self._end_noted = True
        texts = {"how": frontend.life, "last": str(frontend.published)}
        note = self._writer.note
        self._file.add_metadata(note.record("end"), note.run_texts() | texts)
        if frontend.life in ("killed", "superseded"):
            self._note(frontend.published, ERROR, f"the backend was {frontend.life}")

    def _note(self, iteration: int, level: int, text: str) -> None:
        """Adds a line to the log."""
        said = f"row {iteration}: {text}" if iteration >= 0 else text
        self.log.append(Line(self.name, self.log_time(iteration), level, said))

    def log_time(self, iteration: int) -> int:
        """Returns the log time of a row [ns]; if the row is gone, that of the newest row read."""
        if self.frontend is not None and self._writer is not None:
            rows = self.frontend.history(since=iteration, until=iteration)
            if len(rows):
                return int(rows.time[0]) + self._writer.note.wall_offset
        return self._last_log_time or time_ns()

    def _note_gap(self, name: str, first: int, last: int) -> None:
        assert self._writer is not None
        values = self._writer.note.run_texts() | {"first": str(first), "last": str(last)}
        self._file.add_metadata(name, values)


def _oldest_safe(frontend: Frontend) -> int:
    """Returns the oldest row to read; 2 % later if a living backend overwrites rows."""
    oldest = frontend.oldest
    if oldest == 0 or not frontend.alive:
        return oldest
    rows = frontend.published - oldest
    return oldest + rows // 50
