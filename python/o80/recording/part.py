"""Makes recordings from others: cuts times, selects segments, thins rows, merges several."""

import math
import struct
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain, islice
from pathlib import Path
from typing import IO

import numpy as np
from mcap.records import Channel, ChunkIndex

from o80.base.errors import RecordingError
from o80.base.unwritable import writing
from o80.recording.blocks import Block
from o80.recording.epoch import GAP, OVERWRITTEN, EpochNote, channels_of, iteration_in
from o80.recording.file_writer import JOINT_STATES, FileWriter
from o80.recording.joint_states import JointWriter
from o80.recording.journal_channel import CONTENT as JOURNAL
from o80.recording.journal_channel import GAP as JOURNAL_GAP
from o80.recording.journal_channel import Entries
from o80.recording.output import opened
from o80.recording.reader import RecordingFile
from o80.recording.recorded_epoch import RecordedEpoch
from o80.recording.scan import Scan, attachment_of, messages_of
from o80.recording.transforms import TOPIC as TRANSFORMS
from o80.recording.transforms import Poses, TransformWriter

Run = tuple[str, int]  # segment and epoch


@dataclass(frozen=True)
class Selection:
    """Selects the part of recordings to keep."""

    begin: int = 0  #: log time [ns]
    end: int = 2**63
    segments: frozenset[str] | None = None  #: None: all
    every: int = 1  #: keep rows whose iteration is a multiple of this; all decisions are kept
    transforms: float = 0.0  #: rate of added messages with poses of the bodies [Hz]; 0: none

    def holds(self, time: int) -> bool:
        return self.begin <= time <= self.end


def write_part(
    recordings: Sequence[Path],
    output: Path,
    selection: Selection,
    poses: Callable[[str, RecordedEpoch], Poses | None] = lambda name, epoch: None,
) -> dict[str, tuple[int, int, int]]:
    """Writes a new file. Returns number, first and last iteration of each segment's rows.

    poses: returns the bodies of a run to add transforms of, or None.
    Raises RecordingError for a damaged source or a failed write, without leaving a new file.
    """
    read = [RecordingFile(path) for path in recordings]
    sources = [[each for each in recording.scans if each[1].chunks] for recording in read]
    offsets = _offsets_in(chain.from_iterable(sources))
    # files of one recording stay in order, even against time: robots have clocks of their own
    in_order = sorted(
        (each for each in sources if each),
        key=lambda files: min(
            found.chunks.start + _largest(_shifts(found, offsets)) for _, found in files
        ),
    )
    runs = [run for recording in read for run in recording.runs()]
    file = opened(output, proceed=False)
    try:
        with writing(output, RecordingError):
            writer = _PartWriter(file, selection, offsets)
            for name, _, epoch in runs:
                bodies = poses(name, epoch) if selection.transforms else None
                writer.runs[name, epoch.epoch] = epoch, bodies
            for path, found in chain.from_iterable(in_order):
                with found.opened(path) as content:
                    try:
                        writer.add(content, found)
                    except (ValueError, LookupError, struct.error) as error:
                        raise RecordingError(f"{path} is damaged: {error!r:.200}") from error
            for name, _, epoch in runs:
                writer.add_end((name, epoch.epoch), epoch)
            file.finish()
    except BaseException:
        file.close()
        output.unlink(missing_ok=True)
        raise
    return writer.rows


def _notes_in(found: Scan) -> Iterator[EpochNote]:
    for channel in found.channels.values():
        note = EpochNote.of(channel.metadata)
        if note is not None:
            yield note


def _offsets_in(files: Iterable[tuple[Path, Scan]]) -> dict[str, int]:
    """Returns wall clock minus row time by boot [ns]: the largest, as clocks begin in the past."""
    offsets: dict[str, int] = {}
    for _, found in files:
        for note in _notes_in(found):
            if note.boot:
                offsets[note.boot] = max(note.wall_offset, offsets.get(note.boot, 0))
    return offsets


def _shifts(found: Scan, offsets: dict[str, int]) -> dict[Run, int]:
    """Returns shifts of log times by run [ns], which make the runs of one boot agree."""
    return {
        (note.segment, note.epoch): offsets.get(note.boot, note.wall_offset) - note.wall_offset
        for note in _notes_in(found)
    }


def _largest(shifts: dict[Run, int]) -> int:
    return max(shifts.values(), default=0)


class _PartWriter:
    def __init__(self, file: FileWriter, selection: Selection, offsets: dict[str, int]) -> None:
        """offsets: wall clock minus row time of all boots, from `_offsets_in`."""
        self.rows: dict[str, tuple[int, int, int]] = {}
        self._file, self._selection, self._offsets = file, selection, offsets
        self._channels: dict[object, int] = {}
        self._notes: dict[Run, EpochNote] = {}  # of each run, with its number in the new file
        self._next: dict[int, int] = {}  # next row or entry by new channel, to skip duplicates
        self._row_channels: dict[Run, int] = {}
        self._seen: set[tuple[str, int, bytes]] = set()
        #: runs, and bodies whose transforms are added with their rows
        self.runs: dict[Run, tuple[RecordedEpoch, Poses | None]] = {}
        self._derivers: dict[Run, list[JointWriter | TransformWriter]] = {}
        self._is_over: set[int] = set()  # journals that hold all entries up to the end

    def add(self, content: IO[bytes], found: Scan) -> None:
        """Adds the selected part of a file. Raises ValueError if the file is damaged."""
        self._found, self._content = found, content
        self._joint_channels = channels_of(found, JOINT_STATES)
        self._shifts = _shifts(found, self._offsets)
        for chunk in found.chunks:
            if chunk.message_end_time + _largest(self._shifts) >= self._selection.begin:
                blocks = [*self._blocks(chunk)]
                if blocks:
                    self._file.add_messages(blocks)
        for channel in found.channels.values():  # a journal may have no entry
            if (
                channel.metadata.get("content") == JOURNAL
                and _run_of(channel) in self._row_channels
            ):
                self._channel(channel)

    def _derived(self, note: EpochNote, rows: list[tuple[int, bytes]]) -> Iterator[Block]:
        """Yields joint states of rows, if their file has joint states, and due transforms."""
        run = note.segment, note.epoch
        epoch, poses = self.runs[run]
        if run not in self._derivers:
            derivers = self._derivers[run] = []
            if (note.segment, note.number) in self._joint_channels:
                joints = JointWriter.added_to(self._file, epoch.layout, self._notes[run], None)
                derivers += [joints] if joints else []
            if poses is not None and poses.bodies:
                rate = self._selection.transforms
                derivers.append(TransformWriter(self._file, note.segment, poses, rate))
        if self._derivers[run]:
            times = np.array([time for time, _ in rows], np.uint64)
            joined = np.frombuffer(b"".join(message for _, message in rows), np.uint8)
            raw = epoch.decoded(joined.reshape(len(rows), -1))
            yield from filter(None, (each.block(raw, times) for each in self._derivers[run]))

    def add_end(self, run: Run, epoch: RecordedEpoch) -> None:
        """Adds the end of a run: how it ended, that its end is missing, or that it was cut."""
        kept = self._next.get(self._row_channels.get(run, 0), 0)
        if kept == 0 or kept > epoch.next_row:  # nothing is kept, or another recording continues
            return
        texts = {"last": str(kept - 1)}
        if epoch.next_row - kept < self._selection.every:
            texts = epoch.end_record[1] or texts
            if epoch.gaps and epoch.gaps[-1].last is None:
                texts = {"last": str(kept - 1), "reason": epoch.gaps[-1].reason}
        note = self._notes[run]
        self._file.add_metadata(note.record("end"), texts | note.run_texts())

    def _blocks(self, chunk: ChunkIndex) -> Iterator[Block]:
        found, content = self._found, self._content
        derived: list[Block] = []
        for number in sorted(chunk.message_index_offsets):
            channel = found.channels[number]
            note, run = EpochNote.of(channel.metadata), _run_of(channel)
            if run is not None and run[0] not in (self._selection.segments or {run[0]}):
                continue
            if channel.topic == TRANSFORMS and self._selection.transforms:
                continue
            if number in self._joint_channels.values():  # they are derived from rows
                continue
            # marks and the log belong to no run: they get the shift of the file's newest boot
            shift = _largest(self._shifts) if run is None else self._shifts.get(run, 0)
            found_there = messages_of(content, chunk, number)
            messages: Iterable[tuple[int, bytes]] = ((time + shift, m) for time, m in found_there)
            if note is not None and run is not None:
                messages = rows = self._rows(channel, note, messages)
                derived += self._derived(note, rows) if rows else ()
            elif channel.metadata.get("content") == JOURNAL and run is not None:
                messages = self._entries(channel, messages)
            else:  # marks and the log, which recordings of the same time hold twice
                messages = [
                    each
                    for each in messages
                    if self._selection.holds(each[0]) and (channel.topic, *each) not in self._seen
                ]
                self._seen.update((channel.topic, *each) for each in messages)
            if messages:
                yield Block.of(self._channel(channel), [*messages])
        yield from derived

    def _rows(
        self, channel: Channel, note: EpochNote, messages: Iterable[tuple[int, bytes]]
    ) -> list[tuple[int, bytes]]:
        kept, run = [], (note.segment, note.epoch)
        for time, message in messages:
            iteration = iteration_in(message)
            if not self._selection.holds(time) or iteration % self._selection.every:
                continue
            new = self._channel(channel, iteration)
            after = self._next.get(new, iteration)
            if iteration >= after:
                if iteration > after and self._every(channel) == 1:
                    texts = {"first": str(after), "last": str(iteration - 1)}
                    texts |= self._notes[run].run_texts() | {"reason": self._reason(note, after)}
                    self._file.add_metadata(GAP, texts)
                self._row_channels[run] = new
                self._next[new] = iteration + 1
                kept.append((time, message))
                count, first, _ = self.rows.get(note.segment, (0, iteration, iteration))
                self.rows[note.segment] = count + 1, first, iteration
        return kept

    def _entries(
        self, channel: Channel, messages: Iterable[tuple[int, bytes]]
    ) -> list[tuple[int, bytes]]:
        kept = []
        for time, message in messages:
            if time < self._selection.begin:
                continue
            new = self._channel(channel)
            if new in self._is_over:
                continue
            if time > self._selection.end:  # it holds the last decisions before the end
                self._is_over.add(new)
            entries = Entries.of(message, 0)
            after = self._next.get(new, 0)
            if entries.first >= after:
                kept.append((time, message))
            elif entries.next > after:  # of two recorders: a message cannot be divided
                texts = self._texts(channel) | {
                    "first": str(after),
                    "last": str(entries.next - 1),
                }
                self._file.add_metadata(JOURNAL_GAP, texts)
            self._next[new] = max(after, entries.next)
        return kept

    def _begin_run(self, note: EpochNote) -> None:
        """Copies description and provenance of a run, under its number in the new file."""
        found, content = self._found, self._content
        number = sum(name == note.segment for name, _ in self._notes)
        new = self._notes[note.segment, note.epoch] = replace(note, number=number)
        for place in found.attachments:
            if place.name == note.record("description"):
                old = attachment_of(content, place)
                self._file.attach(
                    new.record("description"), old.media_type, old.data, old.create_time
                )
        for each in found.metadata:
            run = each.metadata.get("segment"), each.metadata.get("number")
            if each.name == note.record("provenance"):
                self._file.add_metadata(new.record("provenance"), each.metadata)
            elif each.name == note.record("interruption"):
                shift = self._shifts[note.segment, note.epoch]
                texts = each.metadata | {"number": str(number)}
                texts["since"] = str(int(texts["since"]) + shift)
                self._file.add_metadata(new.record("interruption"), texts)
            elif each.name == JOURNAL_GAP and run == (note.segment, str(note.number)):
                self._file.add_metadata(each.name, each.metadata | {"number": str(number)})

    def _channel(self, channel: Channel, begin: int | None = None) -> int:
        """Returns a channel's number in the new file, adds it if needed; begin: its first row."""
        run = _run_of(channel)
        key = channel.topic, run, channel.metadata.get("content"), channel.message_encoding
        if key not in self._channels:
            texts = channel.metadata if run is None else self._texts(channel)
            if begin is not None:
                if offset := self._offsets.get(texts.get("boot", "")):
                    texts = texts | {"wall_offset": str(offset)}
                texts = texts | {"begin": str(begin), "every": str(self._every(channel))}
                if begin - int(channel.metadata["begin"]) >= self._every(channel):
                    texts |= {"before": "cut away"}
            self._channels[key] = self._file.copy_channel(channel, self._found.schemas, texts)
        return self._channels[key]

    def _texts(self, channel: Channel) -> dict[str, str]:
        """Returns the metadata of a run's channel, with the run's number in the new file."""
        run = _run_of(channel)
        assert run is not None
        if run not in self._notes:
            notes = (each for each in _notes_in(self._found) if (each.segment, each.epoch) == run)
            for note in islice(notes, 1):  # none: another program left out its rows
                self._begin_run(note)
        new = self._notes.get(run)
        return channel.metadata | ({} if new is None else {"number": str(new.number)})

    def _every(self, channel: Channel) -> int:
        """Row interval of a channel in the output, earlier thinning included."""
        text = channel.metadata.get("every", "")
        return math.lcm(self._selection.every, int(text) if text.isdecimal() else 1)

    def _reason(self, note: EpochNote, first: int) -> str:
        """Returns why rows from `first` on are missing in the merged recordings."""
        for each in self._found.metadata:
            texts = each.metadata
            run = texts.get("segment"), texts.get("number"), texts.get("first")
            if each.name == GAP and run == (note.segment, str(note.number), str(first)):
                return texts.get("reason", OVERWRITTEN)
        return "no recording that was merged has them"


def _run_of(channel: Channel) -> Run | None:
    texts = channel.metadata
    if "segment" not in texts or not texts.get("epoch", "").isdecimal():
        return None
    return texts["segment"], int(texts["epoch"])
