"""One segment that is recorded: its rows in order, through restarts of its backend."""

import time
from collections.abc import Mapping
from dataclasses import dataclass

from o80.errors import BackendGone, SegmentError, TimeoutError
from o80.frontend import Frontend
from o80.recording.blocks import Block
from o80.recording.epoch import EpochNote, RowWriter, note_of
from o80.recording.file_writer import FileWriter

GAP = "o80.gap"
"""Name of the metadata record of rows that were overwritten before they were read."""
LARGEST_BLOCK = 4 << 20  # of the rows read at once [bytes]
BETWEEN_LOOKS = 0.05  # for a backend that is not there [s]


@dataclass(frozen=True)
class Written:
    """What a file holds of one epoch already."""

    note: EpochNote
    channel: int
    last: int  #: iteration; -1: no row
    last_log_time: int  #: [ns]


class Source:
    """Reads the rows of a segment by name. Not for several threads."""

    def __init__(
        self, name: str, file: FileWriter, written: Mapping[int, Written], *, whole: bool
    ) -> None:
        """written: by epoch. whole: begin with the oldest row that the segment holds."""
        self.name = name
        self.rows = 0  #: recorded so far
        self.missed = 0  #: overwritten before they were read
        self.behind = 0  #: published and not read, at the last look
        self._file = file
        self._written = dict(written)
        self._whole = whole
        self._frontend: Frontend | None = None
        self._writer: RowWriter | None = None
        self._next = 0
        self._last_log_time = max((each.last_log_time for each in written.values()), default=0)
        self._look_at = 0.0
        self._attach()  # recording begins now
        self._whole = True  # a robot that starts later is recorded from its first row

    @property
    def attached(self) -> bool:
        """Rows come, or may come."""
        return self._frontend is not None

    @property
    def position(self) -> tuple[int, int]:
        """Epoch and iteration of the newest row; -1: none."""
        return (-1 if self._frontend is None else self._frontend.epoch), self.newest

    def has_read(self, position: tuple[int, int]) -> bool:
        """Whether the row at an earlier `position` was read, or lost with its backend."""
        epoch, iteration = position
        return self.position[0] != epoch or self._next > iteration

    @property
    def newest(self) -> int:
        """Iteration of the newest row; -1: there is none."""
        return -1 if self._frontend is None else self._frontend.published

    def close(self) -> None:
        """Detaches."""
        if self._frontend is not None:
            self._frontend.close()
            self._frontend = None

    def poll(self) -> Block | None:
        """The rows that were published since the last call, at most LARGEST_BLOCK bytes."""
        if self._frontend is None and not self._attach():
            return None
        assert self._frontend is not None
        block = self._read(self._frontend)
        if block is None and not self._frontend.alive:
            block = self._read(self._frontend)  # rows published just before its end
            if block is None and self._attach():
                block = self._read(self._frontend)
        return block

    # ------------------------------------------------------------------ which backend

    def _attach(self) -> bool:
        """Attaches to a backend that is not the one that was read. False: there is none."""
        now = time.monotonic()
        if now < self._look_at:
            return False
        self._look_at = now + BETWEEN_LOOKS
        try:
            found = Frontend(self.name, timeout=0, read_only=True, dead=True)
        except (TimeoutError, SegmentError, BackendGone):
            return False
        if found.published < 0 or (self._frontend and found.epoch == self._frontend.epoch):
            found.close()
            return False
        self.close()
        self._begin(found)
        return True

    def _begin(self, frontend: Frontend) -> None:
        self._frontend = frontend
        known = self._written.get(frontend.epoch)
        if known is not None:
            self._writer = RowWriter(frontend._layout, known.note, known.channel)
            self._next = max(known.last + 1, known.note.begin)
            return
        first = frontend.oldest if self._whole or self._written else frontend.published
        note = note_of(frontend, len(self._written), first)
        if self._written:
            first_time = frontend.history(since=first, until=first).time
            if len(first_time):
                note = note.not_before(int(first_time[0]), self._last_log_time)
        self._writer = RowWriter.added_to(self._file, frontend, note)
        self._written[frontend.epoch] = Written(note, self._writer.channel, first - 1, 0)
        self._next = first

    # ------------------------------------------------------------------ its rows

    def _read(self, frontend: Frontend) -> Block | None:
        assert self._writer is not None
        newest = frontend.published
        if newest < self._next:
            self.behind = 0
            return None
        most = max(1, LARGEST_BLOCK // frontend._layout.size)
        last = min(newest, self._next + most - 1)
        rows = frontend.history(since=self._next, until=last).rows
        if not len(rows):  # all of them were overwritten meanwhile
            return None
        first, last = int(rows["iteration"][0]), int(rows["iteration"][-1])
        if first > self._next:
            self._note_gap(self._next, first - 1)
        self._next = last + 1
        self.rows += len(rows)
        self.behind = newest - last
        block = self._writer.block(rows)
        self._last_log_time = block.time_range[1]
        return block

    def _note_gap(self, first: int, last: int) -> None:
        assert self._writer is not None
        self.missed += last - first + 1
        note = self._writer.note
        values = {"segment": note.segment, "epoch": str(note.epoch), "number": str(note.number)}
        self._file.add_metadata(GAP, values | {"first": str(first), "last": str(last)})
