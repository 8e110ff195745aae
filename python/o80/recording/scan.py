"""Reads the contents of an MCAP file, also of a truncated one.

A file of o80 is a sequence of groups, each written by one call: a schema, a channel, an attachment,
a metadata record, or a chunk with the message indexes that follow it. The summary of a finished
file repeats all groups. Without a summary a scan reads every record, and ends before the first
incomplete group.
"""

import contextlib
import os
import shutil
import struct
import tempfile
import weakref
import zlib
from collections.abc import Iterator, Sized
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import IO

import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    Chunk,
    ChunkIndex,
    Footer,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
)
from mcap.stream_reader import breakup_chunk, get_chunk_data_stream
from numpy.typing import NDArray

from o80.base.errors import RecordingError
from o80.base.progress import Progress
from o80.recording.blocks import LENGTH_ENDS_AT, MESSAGE_HEAD
from o80.recording.chunks import HEAD, Chunks

MAGIC = b"\x89MCAP0\r\n"
CUT = "o80.cut"
"""Name of the metadata record behind the last whole chunk of a killed recorder."""
CHUNK_HEAD = struct.Struct("<QQQIL")
FOOTER_LENGTH = HEAD.size + 20 + len(MAGIC)
DATA_END_LENGTH = HEAD.size + 4
BETWEEN_FIGURES = 5000  # records between two reports of progress
DAMAGED = (EndOfFile, ValueError, OverflowError, LookupError, MemoryError, struct.error)


class NotARecordingError(ValueError):
    """The file does not begin like an MCAP file."""


@dataclass
class Scan:
    """The records of a file, except messages."""

    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    chunks: Chunks = field(default_factory=Chunks)
    attachments: list[AttachmentIndex] = field(default_factory=list)
    metadata: list[Metadata] = field(default_factory=list)
    metadata_places: list[MetadataIndex] = field(default_factory=list)
    counts: dict[int, int] = field(default_factory=dict)  #: number of messages, by channel
    end: int = 0  #: end of the last whole group [bytes]
    finished: bool = False  #: the file has a summary and a footer
    summarized: bool = False  #: the summary is complete
    #: messages outside of chunks, chunks without indexes or with channels of their own: another
    #: program has written them
    foreign: bool = False
    copy: "CopiedFile | None" = None  #: copy of a foreign file in the form of o80, scanned instead

    def take(self, opcode: int, stream: ReadDataStream) -> None:
        """Notes a schema or a channel; nothing else."""
        if opcode == Opcode.SCHEMA:
            schema = Schema.read(stream)
            self.schemas[schema.id] = schema
        elif opcode == Opcode.CHANNEL:
            channel = Channel.read(stream)
            self.channels[channel.id] = channel

    def opened(self, path: Path) -> IO[bytes]:
        """Opens the scanned file. Raises OSError if it cannot."""
        return (path if self.copy is None else self.copy.path).open("rb")


class CopiedFile:
    """A file that is removed when this object is garbage-collected."""

    def __init__(self, name: str) -> None:
        folder = tempfile.mkdtemp(prefix="o80-copy-")
        self.path = Path(folder, name)
        weakref.finalize(self, shutil.rmtree, folder, ignore_errors=True)


def scan(path: str | os.PathLike[str]) -> Scan:
    """Reads everything but messages.

    Raises NotARecordingError, RecordingError if a record is damaged, OSError.
    """
    with Path(path).open("rb") as file:
        size = os.fstat(file.fileno()).st_size
        if file.read(len(MAGIC)) != MAGIC:
            raise NotARecordingError(f"{path} is not an MCAP file")
        found = None
        with contextlib.suppress(*DAMAGED):  # a scan of all records reports where
            found = _summary(file, size)
        try:
            found = found or _Scanner(file, size, path).run()
        except DAMAGED as error:
            raise RecordingError(f"{path} is damaged, and its summary too") from error
    known = found.channels.keys()
    for there in found.chunks.channels:
        found.foreign |= not known >= there
        if not there:
            empty = (each for each in found.chunks if not each.message_index_offsets)
            found.foreign |= any(each.uncompressed_size > 0 for each in empty)
    return found


def unreadable(path: Path, error: OSError) -> str:
    """Returns the text of an error about a file of a recording."""
    if isinstance(error, FileNotFoundError):
        return f"{path} was deleted after it had been opened: open the recording again"
    return f"{path} cannot be read: {error.strerror}"


def has_end(path: str | os.PathLike[str]) -> bool:
    """Whether a file ends with a summary and a footer. Raises OSError."""
    with Path(path).open("rb") as file:
        return _footer(file, os.fstat(file.fileno()).st_size) is not None


def _footer(file: IO[bytes], size: int) -> Footer | None:
    """Reads the footer; None if the file has no summary."""
    file.seek(max(0, size - FOOTER_LENGTH))
    data = file.read()
    if len(data) != FOOTER_LENGTH or not data.endswith(MAGIC) or data[0] != Opcode.FOOTER:
        return None
    footer: Footer = Footer.read(ReadDataStream(BytesIO(data[HEAD.size :])))
    return footer if footer.summary_start > 0 else None


def damage_in(path: Path, found: Scan) -> Iterator[str]:
    """Yields texts about wrong checksums, and about message indexes with wrong offsets."""
    with found.opened(path) as file:
        for chunk in found.chunks:
            try:
                at = file.seek(chunk.chunk_start_offset)
                head = Opcode.CHUNK, chunk.chunk_length - HEAD.size
                if HEAD.unpack(file.read(HEAD.size)) != head:
                    raise ValueError(f"the head of the chunk at byte {at} is damaged")
                _check_indexes(file, chunk, content_of(file, chunk))
            except DAMAGED as error:
                yield str(error)
        for place in found.attachments:
            file.seek(place.offset + HEAD.size)
            record = file.read(place.length - HEAD.size)
            if zlib.crc32(record[:-4]) != int.from_bytes(record[-4:], "little"):
                yield f"the attachment {place.name} at byte {place.offset} is damaged"


def _check_indexes(file: IO[bytes], chunk: ChunkIndex, content: bytes) -> None:
    """Raises ValueError if a message index does not lead to the messages of its channel."""
    for channel in chunk.message_index_offsets:
        for time, offset in index_of(file, chunk, channel).tolist():
            head = content[offset : offset + MESSAGE_HEAD.itemsize].ljust(MESSAGE_HEAD.itemsize)
            known = np.frombuffer(head, MESSAGE_HEAD)[0]
            if (known["channel"], known["log_time"]) != (channel, time):
                place = chunk.message_index_offsets[channel]
                raise ValueError(f"the message index at byte {place} is damaged")


def _summary(file: IO[bytes], size: int) -> Scan | None:
    """Scan from the file's summary; None if that is missing or incomplete."""
    footer = _footer(file, size)
    if footer is None or not footer.summary_crc:
        return None
    end = footer.summary_start - DATA_END_LENGTH
    file.seek(max(end, 0))
    data = file.read(size)
    behind = len(data) - len(MAGIC) - 4  # end of the data that the checksum covers
    if end < 0 or len(data) < DATA_END_LENGTH or data[0] != Opcode.DATA_END:
        return None
    if zlib.crc32(data[DATA_END_LENGTH:behind]) != footer.summary_crc:
        return None
    found = Scan(end=end, finished=True, summarized=True)
    statistics: Statistics | None = None
    at = DATA_END_LENGTH
    while at < behind:
        opcode, length = HEAD.unpack_from(data, at)
        at, begin = at + HEAD.size + length, at + HEAD.size
        if opcode == Opcode.CHUNK_INDEX:
            found.chunks.append_record(data[begin - HEAD.size : at])
            continue
        stream = ReadDataStream(BytesIO(data[begin:at]))
        found.take(opcode, stream)
        if opcode == Opcode.ATTACHMENT_INDEX:
            found.attachments.append(AttachmentIndex.read(stream))
        elif opcode == Opcode.METADATA_INDEX:
            found.metadata_places.append(MetadataIndex.read(stream))
        elif opcode == Opcode.STATISTICS:
            statistics = Statistics.read(stream)
    if statistics is None or (statistics.message_count and not found.chunks):
        return None
    groups: dict[str, Sized] = {
        "chunk": found.chunks,
        "attachment": found.attachments,
        "metadata": found.metadata_places,
        "channel": found.channels,
        "schema": found.schemas,
    }
    if any(len(each) != getattr(statistics, f"{name}_count") for name, each in groups.items()):
        return None
    found.counts = statistics.channel_message_counts
    for place in found.metadata_places:
        file.seek(place.offset + HEAD.size)
        found.metadata.append(Metadata.read(ReadDataStream(BytesIO(file.read(place.length)))))
    return found


def content_of(file: IO[bytes], chunk: ChunkIndex) -> bytes:
    """Decompresses the content of a chunk. Raises ValueError if it is damaged."""
    file.seek(chunk.chunk_start_offset + HEAD.size)
    try:
        record = Chunk.read(ReadDataStream(file))
        stream, length = get_chunk_data_stream(record, validate_crc=True)
        return stream.read(length)
    except Exception as error:  # each compression has exceptions of its own
        place = chunk.chunk_start_offset
        raise ValueError(f"the chunk at byte {place} is damaged: {error}") from error


def index_of(file: IO[bytes], chunk: ChunkIndex, channel: int) -> NDArray[np.uint64]:
    """Reads the message index of a channel: (n, 2), log time [ns] and offset in the chunk."""
    file.seek(chunk.message_index_offsets[channel] + HEAD.size + 2)
    (length,) = struct.unpack("<I", file.read(4))
    return np.frombuffer(file.read(length), "<u8").reshape(-1, 2)


def messages_of(file: IO[bytes], chunk: ChunkIndex, channel: int) -> Iterator[tuple[int, bytes]]:
    """Yields log time [ns] and data of a channel's messages. Raises ValueError if damaged."""
    content = content_of(file, chunk)
    for time, begin in index_of(file, chunk, channel).tolist():
        if begin + MESSAGE_HEAD.itemsize > len(content):
            raise ValueError("a message index leads out of its chunk")
        (length,) = struct.unpack_from("<Q", content, begin + 1)
        yield time, content[begin + MESSAGE_HEAD.itemsize : begin + LENGTH_ENDS_AT + length]


def attachment_of(file: IO[bytes], place: AttachmentIndex) -> Attachment:
    """Reads an attachment with its data. Raises ValueError if it is damaged."""
    file.seek(place.offset + HEAD.size)
    try:
        stream = ReadDataStream(BytesIO(file.read(place.length - HEAD.size)))
        attachment: Attachment = Attachment.read(stream)
    except DAMAGED as error:
        raise ValueError(f"the record at byte {place.offset} is damaged") from error
    return attachment


def place_of(attachment: Attachment, offset: int, length: int) -> AttachmentIndex:
    """Makes the summary's entry of an attachment whose record is at `offset` [bytes]."""
    return AttachmentIndex(
        offset,
        length,
        attachment.log_time,
        attachment.create_time,
        len(attachment.data),
        attachment.name,
        attachment.media_type,
    )


class _Scanner:
    def __init__(self, file: IO[bytes], size: int, path: str | os.PathLike[str]) -> None:
        self._file, self._size, self._path = file, size, path
        self._scan = Scan(end=len(MAGIC))
        self._records = 0
        self._progress = Progress(
            f"{path} has no summary (its recorder was killed, or still records), so all of "
            f"it is scanned. o80 repair adds a summary"
        )

    def run(self) -> Scan:
        scan = self._scan
        with self._progress:
            while (record := self._record_at(scan.end)) is not None:
                opcode, at, length = record
                if opcode == Opcode.DATA_END:
                    scan.finished = _footer(self._file, self._size) is not None
                    break
                if opcode == Opcode.MESSAGE_INDEX:  # of no chunk
                    break
                try:
                    if opcode != Opcode.CHUNK:
                        self._take(*record)
                    elif not self._take_chunk(at, length):
                        break
                except DAMAGED as error:
                    raise RecordingError(
                        f"{self._path}: the record at byte {at} is damaged"
                    ) from error
        return scan

    def _record_at(self, at: int) -> tuple[int, int, int] | None:
        """Reads the head of a record: opcode, offset, length; None if it is not whole."""
        self._records += 1
        if self._records % BETWEEN_FIGURES == 0:
            self._progress.at(at / self._size)
        self._file.seek(at)
        head = self._file.read(HEAD.size)
        if len(head) < HEAD.size:
            return None
        opcode, length = HEAD.unpack(head)
        return (opcode, at, length) if at + HEAD.size + length <= self._size else None

    def _take(self, opcode: int, at: int, length: int) -> None:
        """Adds a record that belongs to no chunk."""
        stream = ReadDataStream(BytesIO(self._file.read(length)))
        scan, whole = self._scan, HEAD.size + length
        scan.take(opcode, stream)
        if opcode == Opcode.ATTACHMENT:
            scan.attachments.append(place_of(Attachment.read(stream), at, whole))
        elif opcode == Opcode.MESSAGE:
            scan.foreign = True
        elif opcode == Opcode.METADATA:
            metadata = Metadata.read(stream)
            scan.metadata.append(metadata)
            scan.metadata_places.append(MetadataIndex(at, whole, metadata.name))
        scan.end = at + whole

    def _take_chunk(self, at: int, length: int) -> bool:
        """Adds a chunk and the message indexes after it; False if these are incomplete."""
        start, end, size, _crc, named = CHUNK_HEAD.unpack(self._file.read(32))
        compression = self._file.read(named).decode()
        (compressed,) = struct.unpack("<Q", self._file.read(8))
        offsets, counts = {}, {}
        indexes = after = at + HEAD.size + length
        while (record := self._record_at(after)) and record[0] == Opcode.MESSAGE_INDEX:
            channel, of_entries = struct.unpack("<HI", self._file.read(6))
            offsets[channel], counts[channel] = after, of_entries // 16
            after += HEAD.size + record[2]
        if record is None and self._channels_in(at) != offsets.keys():
            return False
        self._scan.chunks.append(
            ChunkIndex(
                chunk_length=HEAD.size + length,
                chunk_start_offset=at,
                compression=compression,
                compressed_size=compressed,
                message_end_time=end,
                message_index_length=after - indexes,
                message_index_offsets=offsets,
                message_start_time=start,
                uncompressed_size=size,
            )
        )
        for channel, count in counts.items():
            self._scan.counts[channel] = self._scan.counts.get(channel, 0) + count
        self._scan.end = after
        return True

    def _channels_in(self, chunk: int) -> set[int] | None:
        """Returns the channels of the messages in the chunk at this offset; None: it is damaged."""
        self._file.seek(chunk + HEAD.size)
        try:
            records = breakup_chunk(Chunk.read(ReadDataStream(self._file)), validate_crc=True)
        except Exception:  # cut, or damaged
            return None
        return {record.channel_id for record in records if hasattr(record, "channel_id")}
