"""One run of a backend in a recording: its rows and its journal, as from a live frontend."""

import math
from bisect import bisect_right
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import accumulate
from pathlib import Path
from typing import Any, TypeVar, Unpack, overload

import numpy as np
from mcap.records import ChunkIndex
from numpy.typing import NDArray

import o80._core as _core
from o80.base.argument_checks import whole
from o80.base.cached import cached
from o80.base.errors import InvalidArgument, RecordingError, SegmentError
from o80.base.machine import Machine
from o80.recording.blocks import messages_in
from o80.recording.epoch import GAP, OVERWRITTEN, Gap, Interruption, iteration_in
from o80.recording.epoch_part import EpochPart
from o80.recording.journal_channel import GAP as JOURNAL_GAP
from o80.recording.journal_channel import Entries, codec_of
from o80.recording.message_plan import Bytes, Copy, MessagePlan
from o80.recording.message_types import row_type
from o80.recording.scan import content_of
from o80.rows.columns import packing_at
from o80.rows.history import History, Range, Selection
from o80.rows.journal import EntryDecoder, JournalEntry
from o80.rows.layout import Layout, decoder_of
from o80.rows.provenance import Provenance

SMALL = 1 << 17  # size of rows in a chunk up to which a second thread gains nothing [bytes]
T = TypeVar("T")
Paths = list[str] | tuple[str, ...]
RowChunk = tuple[EpochPart, ChunkIndex, NDArray[np.uint64]]  # with the message index of its rows


class Histories:
    """Gives the rows of one run, as a live frontend does."""

    @property
    def _run(self) -> "RecordedEpoch":
        raise NotImplementedError

    @overload
    def history(self, n: int | None = None, **selection: Unpack[Range]) -> History: ...
    @overload
    def history(
        self, n: int | None = None, *, fields: str, **selection: Unpack[Range]
    ) -> NDArray[Any]: ...
    @overload
    def history(
        self, n: int | None = None, *, fields: Paths, **selection: Unpack[Range]
    ) -> tuple[NDArray[Any], ...]: ...
    def history(
        self, n: int | None = None, *, fields: str | Paths | None = None, **selection: Unpack[Range]
    ) -> History | NDArray[Any] | tuple[NDArray[Any], ...]:
        """Returns many observations at once; the arguments are those of `Frontend.history`.

        Raises RecordingError if this part of the file is damaged, InvalidArgument if the segment
        has several epochs: choose one of `epochs`.
        """
        run, wanted = self._run, Selection.checked(n, **selection)
        if fields is None:
            rows = run._read(run._chunks(wanted), run.layout.size)
            return run._history(rows).select(n, **selection)
        arrays = run._columns(wanted, fields)
        return arrays[0] if isinstance(fields, str) else arrays


class RecordedEpoch(Histories):
    """Reads the rows and the journal of one run of a backend."""

    def __init__(self, parts: list[EpochPart], lacks_end: str = "") -> None:
        """parts: in order, at least one. lacks_end: why no record states how the run ended."""
        self._parts = parts
        self._lacks_end = lacks_end
        self._note = note = parts[0].note
        self.epoch = note.epoch  #: number of the run; see `Frontend.epoch`
        self.first_row = note.begin  #: iteration of the first recorded row
        self.wall_offset = note.wall_offset  #: wall-clock time [ns since 1970] minus row time
        self.boot = note.boot  #: id of the boot whose clock the row times use; empty: unknown

    @property
    def _run(self) -> "RecordedEpoch":
        return self

    @property
    def rows(self) -> int:
        """Number of recorded rows."""
        return sum(part.rows for part in self._parts)

    @property
    def chunk_times(self) -> list[tuple[int, int]]:
        """First and last time [ns] of each chunk with rows of this run.

        A chunk may also hold rows of other runs, so that the times may lie outside this run.
        """
        offset = self.wall_offset
        return [
            (each.message_start_time - offset, each.message_end_time - offset)
            for _, each in self._having(None, None)
        ]

    def overlaps(self, other: "RecordedEpoch") -> bool:
        """True if another run was recorded at the same time, by the places of rows in the files.

        Simulated times of two runs cannot be compared.
        """
        (first, last), (begin, end) = self._places, other._places
        return first <= end and begin <= last

    @cached
    def _places(self) -> tuple[tuple[Path, int], tuple[Path, int]]:
        """Places of the first and the last chunk with rows: file, and offset in it [bytes]."""
        chunks = [
            (part.path, chunk.chunk_start_offset)
            for part in self._parts
            for chunk in (next(part.found.chunks.having(part.channel), None), part.last_chunk)
            if chunk is not None
        ]
        return (chunks[0], chunks[-1]) if chunks else ((Path(), 0), (Path(), 0))

    @property
    def model(self) -> str:
        """The model (MJCF) that draws the robot; empty if its driver names none."""
        return self.layout.model

    @cached
    def gaps(self) -> list[Gap]:
        """Ranges of missing rows: first and last iteration, reason.

        The last iteration is None if the end of the run is missing and its last row is unknown.
        Rows after an ordered end of the recording do not count as missing. Raises RecordingError
        if the file is damaged.
        """
        found, after = self._before_end
        last, texts = self.end_record
        why = texts.get("reason") or self._parts[-1].why_cut
        if last >= after:
            every = self._parts[-1].every
            unread = "the recorder ended before it had read them"
            return [*found, Gap(after, last, unread if last >= after + every - 1 else _kept(every))]
        why = why or ("" if texts else self._lacks_end)
        if why and not self.end:
            return [*found, Gap(after, None, why)]
        return found

    @property
    def next_row(self) -> int:
        """Iteration after the last row. Raises RecordingError if the file is damaged."""
        return self._before_end[1]

    @cached
    def _before_end(self) -> tuple[list[Gap], int]:
        """The gaps before the last row, and the iteration after that row."""
        found: list[Gap] = []
        after = 0
        for part in self._parts:
            if part.note.begin > after:
                reason = "a file is missing, or was cut" if after else part.note.before
                found.append(Gap(after, part.note.begin - 1, reason))
            after = part.note.begin + part.rows
            for (first, last), texts in part.records(GAP, "first", "last"):
                reason = texts.get("reason", OVERWRITTEN)
                found.append(Gap(first, last, reason))
                after += last - first + 1
            if part.every > 1 and part.rows:
                after = part.last_row + 1
                if part.rows > 1:
                    found.append(Gap(part.note.begin + 1, after - 1, _kept(part.every)))
        return found, after

    @property
    def missing(self) -> int:
        """Number of rows known to be missing. Raises RecordingError if the file is damaged."""
        kept = sum(part.rows - 1 for part in self._parts if part.every > 1 and part.rows)
        ranges = ((gap.first, gap.last) for gap in self.gaps if gap.last is not None)
        return sum(last - first + 1 for first, last in ranges) - kept

    @property
    def interruption(self) -> Interruption | None:
        """Time before this run in which its segment was not recorded, or None.

        Whole runs may be missing in this time. Raises RecordingError if the file is damaged.
        """
        for part in self._parts:
            for (since,), _ in part.records(part.note.record("interruption"), "since"):
                return Interruption(since, part.log_times[0] if part.rows else self.recorded_at)
        return None

    @property
    def journal_gaps(self) -> list[tuple[int, int]]:
        """First and last number of each range of entries that were overwritten before a read."""
        return [
            (first, last)
            for part in self._parts
            for (first, last), _ in part.records(JOURNAL_GAP, "first", "last")
        ]

    @property
    def layout(self) -> Layout:
        """Offsets and types of all fields of a row."""
        layout: Layout = self._decoder.layout
        return layout

    @property
    def schema(self) -> dict[str, Any]:
        """The description of the robot."""
        return self.layout.schema

    @cached
    def provenance(self) -> Provenance:
        """How the backend was started, as `Frontend.provenance`. RecordingError if unknown."""
        return self._started("json", Provenance.from_json)

    @property
    def machine(self) -> Machine:
        """The machine that made the recording. Raises RecordingError if it is unknown."""
        return self._started("machine", Machine.from_json)

    def _started(self, key: str, read: Callable[[str], T]) -> T:
        part, record = self._parts[0], self._note.record("provenance")
        found = [each.metadata for each in part.found.metadata if each.name == record]
        if not found:
            raise RecordingError(f"{part.path} does not say how '{self._note.segment}' was started")
        try:
            return read(found[0][key])
        except (KeyError, TypeError, ValueError, RecursionError) as error:
            raise RecordingError(f"{part.path}: the record {record} is damaged") from error

    @cached
    def _decoder(self) -> Any:
        table = self._parts[0].table()
        try:
            return decoder_of(table, self._note.epoch)
        except SegmentError as error:
            raise RecordingError(
                f"{self._parts[0].path}: the description of '{self._note.segment}' is damaged"
            ) from error

    @cached
    def description(self) -> _core.Description:
        """The description of the robot as the compiled library reads it."""
        self._decoder  # noqa: B018  reports a damaged description
        return _core.Description(self._parts[0].table())

    # ------------------------------------------------------------------ rows

    def _columns(self, wanted: Selection, fields: str | Paths) -> tuple[NDArray[Any], ...]:
        packing = packing_at(self.layout, fields, "iteration", "time")
        copies = self._plan.packed(packing.parts)
        rows = self._read(self._chunks(wanted), packing.dtype.itemsize, copies)
        *arrays, iterations, times = packing.arrays(rows.view(packing.dtype)[:, 0])
        kept = wanted.place(iterations, times)
        return tuple(each[kept] for each in arrays)

    def blocks(
        self, *, from_time: int | None = None, to_time: int | None = None
    ) -> Iterator[History]:
        """Yields the rows between two times [ns] in order, block by block.

        For recordings larger than the memory. Raises RecordingError if this part is damaged.
        """
        for part, chunk in self._having(from_time, to_time):
            with part.reading():
                rows = self.decoded(part.messages(chunk))
            history = self._history(rows).select(from_time=from_time, to_time=to_time)
            if len(history):
                yield history

    @property
    def time_range(self) -> tuple[int, int]:
        """Times of the first and the last row [ns]. Raises RecordingError if there is none."""
        with_rows = [part for part in self._parts if part.rows]
        if not with_rows:
            raise RecordingError(f"{self._parts[0].path}: '{self._note.segment}' has no row")
        first, last = with_rows[0].log_times[0], with_rows[-1].log_times[1]
        return first - self.wall_offset, last - self.wall_offset

    @property
    def recorded_at(self) -> int:
        """Wall-clock time at which recording of the run began [ns since 1970]."""
        return self._parts[0].began_at

    def _having(
        self, from_time: int | None, to_time: int | None, *, newest_first: bool = False
    ) -> Iterator[tuple[EpochPart, ChunkIndex]]:
        """Yields chunks that may have rows of these times, each with its part."""
        start = 0 if from_time is None else from_time + self.wall_offset
        end = 2**64 if to_time is None else to_time + self.wall_offset
        for part in reversed(self._parts) if newest_first else self._parts:
            for chunk in part.found.chunks.having(
                part.channel, start=start, end=end, newest_first=newest_first
            ):
                yield part, chunk

    def _chunks(self, wanted: Selection) -> list[RowChunk]:
        """Returns the chunks that hold the selected rows, in order."""
        begin, left = wanted.from_time, math.inf if wanted.n is None else wanted.n
        if wanted.duration is not None and self.rows:
            begin = self.time_range[1] - wanted.duration
        found = []
        for part, chunk in self._having(begin, wanted.to_time, newest_first=True):
            if left <= 0:
                break
            found.append((part, chunk))
            left -= len(part.index(chunk)) if wanted.n is not None else 0
        found.reverse()
        if wanted.until is not None:
            found = found[: bisect_right(found, wanted.until, key=_first_row)]
        if wanted.since is not None:
            found = found[max(0, bisect_right(found, wanted.since, key=_first_row) - 1) :]
        return [(part, chunk, part.index(chunk)) for part, chunk in found]

    def _history(self, rows: Bytes) -> History:
        return History(self._decoder, rows.view(self.layout.row)[:, 0])

    def _read(
        self, chunks: Sequence[RowChunk], size: int, copies: list[Copy] | None = None
    ) -> Bytes:
        """Decompresses and decodes chunks to rows (n, size), in two threads if they are large."""
        plan, ends = self._plan, [*accumulate(len(index) for *_, index in chunks)]
        rows = np.zeros((ends[-1] if ends else 0, size), np.uint8)  # padding is zero

        def decode(chunk: RowChunk, end: int) -> None:
            part, place, index = chunk
            with part.reading() as file:
                messages = messages_in(content_of(file, place), index)
                plan.decode(messages, rows[end - len(messages) : end], copies)

        with ThreadPoolExecutor(2) as threads:
            run = threads.map if len(rows) * plan.size > len(chunks) * SMALL else map
            _ = [*run(decode, chunks, ends)]
        return rows

    @cached
    def _plan(self) -> MessagePlan:
        return MessagePlan(row_type(self.layout))

    def decoded(self, messages: Bytes) -> Bytes:
        """Decodes messages (n, size) to rows (n, bytes of a row). Raises ValueError."""
        rows = np.zeros((len(messages), self.layout.size), np.uint8)  # padding is zero
        self._plan.decode(messages, rows)
        return rows

    @property
    def end(self) -> str:
        """How the run ended: "stopped", "killed", "superseded", or "failed: " with the reason.

        Empty if the recording lacks the end, for example because recording ended before the run.
        Raises RecordingError if the file is damaged.
        """
        return self._end_in_journal() or self.end_record[1].get("how", "")

    @property
    def end_record(self) -> tuple[int, dict[str, str]]:
        """The recorder's record of the end: last row (-1: none) and texts."""
        found = [
            each for part in self._parts for each in part.records(part.note.record("end"), "last")
        ]
        return (found[-1][0][0], found[-1][1]) if found else (-1, {})

    def _end_in_journal(self) -> str:
        entries = [*self.last_entries(1)]
        if not entries or entries[-1].kind != "ended":
            return ""
        return f"failed: {entries[-1].text}" if entries[-1].text else "stopped"

    # ------------------------------------------------------------------ journal

    def journal(self, since: int = 0) -> list[JournalEntry]:
        """Returns the decisions of the backend, oldest first, as `Frontend.journal` does.

        The first entry is the oldest that the segment held when recording began; it may be older
        than the first row. since: number of the first entry to return.

        Raises RecordingError if this part of the file is damaged.
        """
        decoder = EntryDecoder(self.schema)
        return [decoder.entry(entry) for entry in self.native_journal(since)]

    def native_journal(
        self, since: int = 0, *, rests: bool = False
    ) -> Iterator[_core.JournalEntry]:
        """Yields the entries of `journal` before their conversion to Python, read on demand.

        rests: include the entries `at_rest`, from which on nothing acts, for a replay.
        """
        native = _core.RecordedJournal(self.description, whole(since, "since", 0), rests)
        for part in self.journal_parts():
            yield from self._decoded(native, part)

    def last_entries(self, most: int) -> Iterator[_core.JournalEntry]:
        """Yields the newest entries, at least `most` or all of them, the newest chunk first.

        None if a newer o80 wrote the journal. Batches whose records are split over two chunks come
        without records. Raises RecordingError.
        """
        codec = self.journal_codec
        if codec is None or codec > _core.JOURNAL_CODEC:
            return
        for part in self.journal_parts(newest_first=True):
            found = self._decoded(_core.RecordedJournal(self.description, 0), part)
            yield from found
            most -= len(found)
            if most <= 0:
                break

    @property
    def has_journal(self) -> bool:
        """True if the backend had a journal and the recorder wrote it."""
        return any(part.journal is not None for part in self._parts)

    @property
    def journal_codec(self) -> int | None:
        """Version of the journal's format, the newest of all files; None: no journal.

        Raises RecordingError if a version is damaged.
        """
        codecs = []
        for part in self._parts:
            if part.journal is not None:
                with part.reading():
                    codecs.append(codec_of(part.found, part.journal))
        return max(codecs, default=None)

    def journal_since_row(self, first: int) -> list[JournalEntry]:
        """Returns entries from `first` on, and earlier batches of commands that end after it.

        Raises RecordingError if this part of the file is damaged.
        """
        decoder = EntryDecoder(self.schema)
        blocks: list[list[JournalEntry]] = []
        ended: set[tuple[int | None, int | None]] = set()  # lane and id
        begun: set[tuple[int | None, int | None]] = set()
        for part in self.journal_parts(newest_first=True):
            native = _core.RecordedJournal(self.description, 0)
            block = [decoder.entry(each) for each in self._decoded(native, part)]
            for each in block:
                begun.update((each.lane, command.id) for command in each.commands)
                if each.iteration >= first and each.kind == "status":
                    ended.add((each.lane, each.id))
            blocks.append(block)
            if block and block[0].iteration < first and ended <= begun:
                break
        return [each for block in reversed(blocks) for each in block]

    def journal_parts(self, *, newest_first: bool = False) -> Iterator[Entries]:
        """Yields the journal's entries as stored in the files, for `_core.RecordedJournal`.

        Raises RecordingError if this part of the file is damaged.
        """
        for part in reversed(self._parts) if newest_first else self._parts:
            yield from part.entries(newest_first=newest_first)

    def _decoded(self, native: _core.RecordedJournal, part: Entries) -> list[_core.JournalEntry]:
        try:
            return native.decode(part.content, part.codec)
        except (InvalidArgument, ValueError, LookupError) as error:
            raise RecordingError(f"{self._parts[0].path}: {error}") from error

    def __repr__(self) -> str:
        return f"<epoch of {self._note.segment}: {self.rows} rows>"


def _kept(every: int) -> str:
    return f"every {every}th row was kept"


def _first_row(chunk: tuple[EpochPart, ChunkIndex]) -> int:
    """Reads the iteration of a chunk's first row."""
    part, place = chunk
    return iteration_in(part.messages(place)[0].tobytes())
