"""Recordings made of others: a stretch of time, some segments, every nth row, several in one."""

from __future__ import annotations

import struct
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import IO, TYPE_CHECKING

from o80.base.errors import RecordingError
from o80.base.unwritable import reason
from o80.recording import joint_states
from o80.recording.blocks import Messages
from o80.recording.cdr import ENCAPSULATION
from o80.recording.epoch import GAP, EpochNote
from o80.recording.journal_channel import CONTENT as JOURNAL
from o80.recording.journal_channel import GAP as JOURNAL_GAP
from o80.recording.journal_channel import Entries
from o80.recording.output import opened
from o80.recording.reader import RecordingFile
from o80.recording.scan import attachment_of, index_of, messages_of

if TYPE_CHECKING:
    from mcap.records import Channel, ChunkIndex

    from o80.recording.file_writer import FileWriter
    from o80.recording.scan import Scan

Run = tuple[str, int]  # segment and epoch


@dataclass(frozen=True)
class Selection:
    """The part of recordings that is kept."""

    begin: int = 0  #: log time [ns]
    end: int = 2**63
    segments: frozenset[str] | None = None  #: None: all
    every: int = 1  #: keep rows whose iteration is a multiple of it; decisions are kept all

    def holds(self, time: int) -> bool:
        return self.begin <= time <= self.end


def write_part(
    recordings: Sequence[Path], output: Path, selection: Selection
) -> dict[str, tuple[int, int, int]]:
    """Writes a new file. Returns number, first and last iteration of the rows of each segment.

    Raises RecordingError: then no new file is left.
    """
    sources = [each for path in recordings for each in RecordingFile(path).scans if each[1].chunks]
    sources.sort(key=lambda source: source[1].chunks[0].message_start_time)
    file = opened(output, proceed=False)
    try:
        writer = _PartWriter(file, selection)
        for path, found in sources:
            with found.opened(path) as content:
                try:
                    writer.add(content, found)
                except (ValueError, LookupError, struct.error) as error:
                    raise RecordingError(f"{path} is damaged: {error!r:.200}") from error
        file.finish()
    except OSError as error:
        file.close()
        output.unlink(missing_ok=True)
        raise RecordingError(f"{output} cannot be written: {reason(output, error)}") from error
    except BaseException:
        file.close()
        output.unlink(missing_ok=True)
        raise
    return writer.rows


class _PartWriter:
    def __init__(self, file: FileWriter, selection: Selection) -> None:
        self.rows: dict[str, tuple[int, int, int]] = {}
        self._file, self._selection = file, selection
        self._channels: dict[object, int] = {}
        self._numbers: dict[Run, int] = {}  # of runs in the new file
        self._next: dict[int, int] = {}  # by new channel: what comes next, so nothing comes twice
        self._seen: set[tuple[str, int, bytes]] = set()
        self._is_over: set[int] = set()  # journals that have what lies behind the end

    def add(self, content: IO[bytes], found: Scan) -> None:
        """Adds what is kept of a file. Raises ValueError if it is damaged."""
        self._found, self._content = found, content
        for chunk in found.chunks:
            if chunk.message_end_time >= self._selection.begin:
                blocks = [*self._blocks(chunk)]
                if blocks:
                    self._file.add_chunk(blocks)

    def _blocks(self, chunk: ChunkIndex) -> Iterator[Messages]:
        found, content = self._found, self._content
        kept: dict[Run, set[int]] = {}  # log times of rows
        for number in sorted(chunk.message_index_offsets):
            channel = found.channels[number]
            note, run = EpochNote.of(channel.metadata), _run_of(channel)
            if run is not None and run[0] not in (self._selection.segments or {run[0]}):
                continue
            times = [int(time) for time in index_of(content, chunk, number)[:, 0]]
            messages: Iterable[tuple[int, bytes]] = zip(
                times, messages_of(content, chunk, number), strict=True
            )
            if note is not None and run is not None:
                messages = self._rows(channel, note, messages)
                kept[run] = {time for time, _ in messages}
            elif channel.metadata.get("content") == JOURNAL and run is not None:
                messages = self._entries(channel, messages)
            elif channel.metadata.get("content") == joint_states.CONTENT and run in kept:
                messages = [each for each in messages if each[0] in kept[run]]
            else:  # marks and the log; recordings of the same time have them twice
                messages = [
                    each
                    for each in messages
                    if self._selection.holds(each[0]) and (channel.topic, *each) not in self._seen
                ]
                self._seen.update((channel.topic, *each) for each in messages)
            if messages:
                yield Messages(self._channel(channel), [*messages])

    def _rows(
        self, channel: Channel, note: EpochNote, messages: Iterable[tuple[int, bytes]]
    ) -> list[tuple[int, bytes]]:
        kept = []
        begin = len(ENCAPSULATION)  # the iteration is the first member
        for time, message in messages:
            iteration = int.from_bytes(message[begin : begin + 8], "little", signed=True)
            if not self._selection.holds(time) or iteration % self._selection.every:
                continue
            new = self._channel(channel, iteration)
            if iteration >= self._next.get(new, 0):
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
            if time > self._selection.end:  # has what was decided before
                self._is_over.add(new)
            entries = Entries.of(message, 0)
            after = self._next.get(new, 0)
            if entries.first >= after:
                kept.append((time, message))
            elif entries.next > after:  # two recorders: a message cannot be divided
                texts = self._texts(channel) | {
                    "first": str(after),
                    "last": str(entries.next - 1),
                }
                self._file.add_metadata(JOURNAL_GAP, texts)
            self._next[new] = max(after, entries.next)
        return kept

    def _begin_run(self, note: EpochNote) -> None:
        """Copies how the run was started, under its number in the new file."""
        found, content = self._found, self._content
        numbers = [number for (name, _), number in self._numbers.items() if name == note.segment]
        number = self._numbers[note.segment, note.epoch] = len(numbers)
        new = replace(note, number=number)
        for place in found.attachments:
            if place.name == note.attachment:
                old = attachment_of(content, place)
                self._file.attach(new.attachment, old.media_type, old.data, old.create_time)
        for each in found.metadata:
            run = each.metadata.get("segment"), each.metadata.get("number")
            if each.name == note.provenance:
                self._file.add_metadata(new.provenance, each.metadata)
            elif each.name in (GAP, JOURNAL_GAP) and run == (note.segment, str(note.number)):
                self._file.add_metadata(each.name, each.metadata | {"number": str(number)})

    def _channel(self, channel: Channel, begin: int | None = None) -> int:
        """The channel of the new file; begin: its first row."""
        run = _run_of(channel)
        key = channel.topic, run, channel.metadata.get("content"), channel.message_encoding
        if key not in self._channels:
            texts = channel.metadata if run is None else self._texts(channel)
            if begin is not None:
                texts = texts | {"begin": str(begin)}
            number, schema = 0, self._found.schemas.get(channel.schema_id)
            if schema is not None:
                text = schema.data.decode(errors="replace")
                number = self._file.add_schema(schema.name, text, encoding=schema.encoding)
            self._channels[key] = self._file.add_channel(
                channel.topic, number, texts, encoding=channel.message_encoding
            )
        return self._channels[key]

    def _texts(self, channel: Channel) -> dict[str, str]:
        """The metadata of a channel of a run, with the number of the run in the new file."""
        run = _run_of(channel)
        assert run is not None
        if run not in self._numbers:
            notes = (EpochNote.of(each.metadata) for each in self._found.channels.values())
            for note in notes:
                if note is not None and (note.segment, note.epoch) == run:
                    self._begin_run(note)
                    break
        return channel.metadata | {"number": str(self._numbers.get(run, 0))}


def _run_of(channel: Channel) -> Run | None:
    texts = channel.metadata
    if "segment" not in texts or not texts.get("epoch", "").isdecimal():
        return None
    return texts["segment"], int(texts["epoch"])
