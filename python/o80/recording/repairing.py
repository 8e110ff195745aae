"""Repairs recordings: copies the intact records of a damaged file into a new one.

The whole file is searched for records, because a damaged length can point anywhere. Chunks have
checksums; the message indexes are rebuilt.
"""

import mmap
import re
import zlib
from collections.abc import Iterator
from contextlib import suppress
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, Metadata, Schema
from mcap.stream_reader import get_chunk_data_stream

from o80.base.errors import RecordingError
from o80.base.unwritable import writing
from o80.recording.blocks import LENGTH_ENDS_AT, MESSAGE, MESSAGE_STRUCT, Block
from o80.recording.chunks import HEAD
from o80.recording.epoch import GAP, EpochNote, iteration_in
from o80.recording.file_writer import FileWriter
from o80.recording.journal_channel import CONTENT as JOURNAL
from o80.recording.journal_channel import GAP as JOURNAL_GAP
from o80.recording.journal_channel import Entries
from o80.recording.locked_file import LockedFile
from o80.recording.output import opened
from o80.recording.reader import errors_explained
from o80.recording.scan import CUT, MAGIC, Scan, damage_in, has_end, scan

REASON = "damaged"
READ = mmap.ACCESS_READ
_KEPT: dict[Opcode, Any] = {
    Opcode.SCHEMA: Schema,
    Opcode.CHANNEL: Channel,
    Opcode.CHUNK: Chunk,
    Opcode.ATTACHMENT: Attachment,
    Opcode.METADATA: Metadata,
}
_MADE_ANEW = {*Opcode} - _KEPT.keys()
_HEADS = re.compile(rb"[\x03\x04\x06\x09\x0c].{4}\0{4}", re.DOTALL)  # heads of kept records


class Part(NamedTuple):
    """A range of a file: an intact record to keep, or damaged bytes."""

    begin: int
    end: int
    opcode: int = 0  #: opcode of the record; 0: damaged


def repaired(path: Path, *, is_last: bool) -> list[str]:
    """Completes or repairs a file; returns texts about the changes, none if it is intact.

    is_last: no file of the recording follows this one. A damaged file is kept as
    NAME.mcap.damaged. Raises RecordingError if the file cannot be repaired.
    """
    with errors_explained(path):
        size, found = path.stat().st_size, None
        if size >= len(MAGIC):
            with suppress(RecordingError):
                found = scan(path)
            damage = [] if found is None else [*damage_in(path, found)]
            if found is not None and found.foreign and damage:
                raise RecordingError("\n".join(f"{path}: {each}" for each in damage))
            if found is None or damage or _has_data_behind(path, found):
                return _salvaged(path, found, is_last)
            if found.finished and (found.foreign or found.summarized):
                return []
    file = opened(path, proceed=True)
    kept = file.kept
    file.finish()
    if size < len(MAGIC):
        return [f"{path} held no rows: it is a complete recording without segments now"]
    return [f"{path} is complete now: {kept} bytes kept, {size - kept} bytes after them removed"]


def _has_data_behind(path: Path, found: Scan) -> bool:
    """True if intact data follow the record at which the scan of a file ended."""
    if found.finished:
        return False
    of_data = (Opcode.CHUNK, Opcode.ATTACHMENT, Opcode.METADATA)  # the summary has others
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=READ) as data:
        parts = _parts(data, found.end)
        return any(part.opcode in of_data and part.begin > found.end for part in parts)


def _salvaged(path: Path, found: Scan | None, is_last: bool) -> list[str]:
    new, kept = (path.with_name(f"{path.name}.{each}") for each in ("repaired", "damaged"))
    if kept.exists():
        raise RecordingError(f"{kept} exists: {path} was repaired before; move it away first")
    with writing(path, RecordingError):
        try:
            lock = LockedFile(path, 0)
        except BlockingIOError:
            raise RecordingError(f"{path} is being written by a recorder: end it first") from None
        new.unlink(missing_ok=True)  # left by a killed repair
        file = opened(new, proceed=False)
        try:
            with path.open("rb") as old, mmap.mmap(old.fileno(), 0, access=READ) as data:
                salvage = _Salvage(data, file, found)
                dropped = salvage.run(is_last, was_cut=not has_end(path))
            file.finish()
            path.rename(kept)
            new.rename(path)
        finally:
            file.close()
            new.unlink(missing_ok=True)
            lock.close()
    ranges = [
        f"{path}: bytes {each.begin} to {each.end - 1} were damaged and are dropped"
        for each in dropped
    ]
    ranges += [f"{path}: {name} is damaged, and kept as it is" for name in salvage.doubtful]
    return [*ranges, f"{path} has all intact records; the damaged file is {kept.name} now"]


def _parts(data: mmap.mmap, at: int = len(MAGIC), found: Scan | None = None) -> Iterator[Part]:
    """Yields records to keep and damaged ranges of a file, without records that are rebuilt.

    found: gives the offsets of records whose own heads are damaged.
    """
    known = {} if found is None else _places_in(found)
    places = sorted((each for each in known if each < len(data)), reverse=True)
    after = at  # end of the last record to keep
    while True:
        match = _HEADS.search(data, at)
        while places and places[-1] < at:
            places.pop()
        if match is None and not places:
            break
        begin = min(places[-1:] + ([match.start()] if match else []))
        opcode, length = known.get(begin) or HEAD.unpack_from(data, begin)
        end = begin + HEAD.size + length
        if end > len(data) or _record(opcode, data[begin + HEAD.size : end]) is None:
            at = begin + 1
            continue
        if not _is_made_anew(data, after, begin):
            yield Part(after, begin)
        yield Part(begin, end, opcode)
        at = after = end
    if not _is_made_anew(data, after, len(data)):
        yield Part(after, len(data))


def _places_in(found: Scan) -> dict[int, tuple[Opcode, int]]:
    """Returns opcode and length of chunks, attachments and metadata, by offset."""
    chunks = {each.chunk_start_offset: each.chunk_length for each in found.chunks}
    attachments = {each.offset: each.length for each in found.attachments}
    texts = {each.offset: each.length for each in found.metadata_places}
    of = {Opcode.CHUNK: chunks, Opcode.ATTACHMENT: attachments, Opcode.METADATA: texts}
    return {
        place: (opcode, length - HEAD.size)
        for opcode, places in of.items()
        for place, length in places.items()
    }


def _is_made_anew(data: mmap.mmap, at: int, end: int) -> bool:
    """True if a range consists of records that are rebuilt from others."""
    while at + HEAD.size <= end:
        opcode, length = HEAD.unpack_from(data, at)
        if opcode not in _MADE_ANEW:
            break
        at += HEAD.size + length
    return at == end or (end == len(data) and data[at:end] == MAGIC)


def _record(opcode: int, content: bytes) -> Any:
    """Parses a record to keep; None if it is damaged."""
    stream = BytesIO(content)
    try:
        record = _KEPT[Opcode(opcode)].read(ReadDataStream(stream))
        if opcode == Opcode.SCHEMA:
            record.data.decode()
        elif opcode == Opcode.CHUNK:
            for _ in _messages(record):
                pass
    except Exception:  # each compression has exceptions of its own
        return None
    return record if stream.tell() == len(content) else None


def _messages(chunk: Chunk) -> Iterator[tuple[int, int, bytes]]:
    """Yields channel, log time and data of each message. Raises any exception if damaged."""
    stream, length = get_chunk_data_stream(chunk, validate_crc=True)
    content, at = stream.read(length), 0
    while at < length:
        opcode, size, channel, _, time, _ = MESSAGE_STRUCT.unpack_from(content, at)
        begin, at = at + MESSAGE_STRUCT.size, at + LENGTH_ENDS_AT + size
        if opcode != MESSAGE or not begin <= at <= length:
            raise ValueError
        yield channel, time, content[begin:at]


def _numbers(record: Metadata, *names: str) -> tuple[int, ...]:
    """Parses numbers of a metadata record, which has no checksum; -1: damaged."""
    texts = [record.metadata.get(name, "") for name in names]
    return tuple(int(text) if text.isdecimal() else -1 for text in texts)


class _Salvage:
    """Copies whole records, each once, and notes which rows and journal entries are missing."""

    def __init__(self, data: mmap.mmap, file: FileWriter, found: Scan | None) -> None:
        self._data, self._file = data, file
        self._parts = [*_parts(data, found=found)]
        self._channels: dict[int, Channel] = {}
        self._new: dict[int, int] = {}  # number of each channel in the new file
        self._next: dict[int, int] = {}  # next row or journal entry, by channel
        self._last: dict[int, int] = {}  # end of the last chunk, by channel [bytes]
        self.doubtful: list[str] = []  #: damaged attachments: kept, because rows may depend on them
        self._holes: list[tuple[str, int, int, int]] = []  # name of the record, channel, range

    def run(self, is_last: bool, *, was_cut: bool) -> list[Part]:
        """Writes everything but the summary. Returns the damaged ranges."""
        self._add_channels()
        seen = set()
        for part in self._parts:
            raw = self._data[part.begin + HEAD.size : part.end]
            key = zlib.crc32(raw), len(raw)
            record = _record(part.opcode, raw) if part.opcode else None
            is_cut = isinstance(record, Metadata) and record.name == CUT  # may come twice
            if key in seen and not is_cut:
                continue
            seen.add(key)
            if isinstance(record, Attachment):
                if zlib.crc32(raw[:-4]) != int.from_bytes(raw[-4:], "little"):
                    self.doubtful.append(record.name)
                self._file.attach(record.name, record.media_type, record.data, record.create_time)
            elif isinstance(record, Metadata):
                self._file.add_metadata(record.name, record.metadata)
            elif isinstance(record, Chunk):
                self._add_chunk(record, part.end)
        damaged = [part for part in self._parts if part.opcode == 0]
        self._note_ends(damaged[-1].end if is_last and damaged else 0)
        self._note_holes()
        if was_cut:
            self._file.add_metadata(CUT, {})
        return damaged

    def _add_channels(self) -> None:
        """Adds the last copy of each channel: the one in the summary, which has a checksum."""
        schemas: dict[int, Schema] = {}
        for begin, end, opcode in self._parts:
            if opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                record = _record(opcode, self._data[begin + HEAD.size : end])
                (schemas if opcode == Opcode.SCHEMA else self._channels)[record.id] = record
        for channel in self._channels.values():
            self._new[channel.id] = self._file.copy_channel(channel, schemas, channel.metadata)

    def _add_chunk(self, chunk: Chunk, end: int) -> None:
        kept: dict[int, list[tuple[int, bytes]]] = {}
        for number, time, message in _messages(chunk):
            if number in self._channels and self._is_next(number, message):
                kept.setdefault(number, []).append((time, message))
                self._last[number] = end
        if kept:
            blocks = [Block.of(self._new[number], each) for number, each in kept.items()]
            self._file.add_messages(blocks)

    def _is_next(self, number: int, message: bytes) -> bool:
        """False if later rows or entries were written already. Notes a hole before the message."""
        texts = self._channels[number].metadata
        note = EpochNote.of(texts)
        if note is not None:
            first = iteration_in(message)
            after, name, expected = first + 1, GAP, self._next.get(number, note.begin)
        elif texts.get("content") == JOURNAL:
            try:
                entries = Entries.of(message, 0)
            except ValueError:
                return True
            first, after, name = entries.first, entries.next, JOURNAL_GAP
            expected = self._next.get(number, first)
        else:
            return True
        if first > expected and texts.get("every", "1") == "1":
            self._holes.append((name, number, expected, first - 1))
        self._next[number] = max(after, expected)
        return first >= expected

    def _note_ends(self, damage_end: int) -> None:
        """Notes damaged ends of runs: the last row is known only if the end was recorded."""
        ends = {each.name: each for each in self._file.found.metadata}
        for number, channel in self._channels.items():
            note = EpochNote.of(channel.metadata)
            if note is None:
                continue
            after = self._next.get(number, note.begin)
            if note.record("end") in ends:
                (last,) = _numbers(ends[note.record("end")], "last")
                if last >= after:
                    self._holes.append((GAP, number, after, last))
            elif damage_end > self._last.get(number, 0):
                texts = note.run_texts() | {"last": str(after - 1), "reason": REASON}
                self._file.add_metadata(note.record("end"), texts)

    def _note_holes(self) -> None:
        known = [each for each in self._file.found.metadata if each.name in (GAP, JOURNAL_GAP)]
        for name, number, begin, end in self._holes:
            texts = self._channels[number].metadata
            run = {key: texts[key] for key in ("segment", "epoch", "number") if key in texts}
            noted = sorted(
                _numbers(each, "first", "last")
                for each in known
                if each.name == name and run.items() <= each.metadata.items()
            )
            for first, last in [*noted, (end + 1, end + 1)]:
                if begin < first <= end + 1:
                    hole = {"first": str(begin), "last": str(first - 1), "reason": REASON}
                    self._file.add_metadata(name, run | hole)
                begin = max(begin, last + 1)
