"""Contents of an MCAP file, also of one that was cut off in the middle.

A file of o80 is a sequence of groups, each written by one call: a schema, a channel, an attachment,
a metadata record, or a chunk with the message indexes that follow it. A scan ends before the first
group that is not whole.
"""

import os
import struct
from collections.abc import Iterator
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
    Header,
    Metadata,
    MetadataIndex,
    Schema,
)
from mcap.stream_reader import breakup_chunk, get_chunk_data_stream
from numpy.typing import NDArray

from o80.base.errors import RecordingError
from o80.recording.blocks import LENGTH_ENDS_AT, MESSAGE_HEAD

MAGIC = b"\x89MCAP0\r\n"
HEAD = struct.Struct("<BQ")
CHUNK_HEAD = struct.Struct("<QQQIL")
FOOTER_LENGTH = HEAD.size + 20 + len(MAGIC)


class NotARecordingError(ValueError):
    """The file does not begin as an MCAP file does."""


@dataclass
class Scan:
    """The records of a file, except messages."""

    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    chunks: list[ChunkIndex] = field(default_factory=list)
    attachments: list[AttachmentIndex] = field(default_factory=list)
    metadata: list[Metadata] = field(default_factory=list)
    metadata_places: list[MetadataIndex] = field(default_factory=list)
    counts: dict[int, int] = field(default_factory=dict)  #: messages, by channel
    end: int = 0  #: of the last whole group [bytes]
    finished: bool = False  #: with a summary and a footer
    library: str = ""


def scan(path: str | os.PathLike[str]) -> Scan:
    """Reads everything but messages.

    Raises NotARecordingError, RecordingError if a record is damaged, OSError.
    """
    with Path(path).open("rb") as file:
        size = os.fstat(file.fileno()).st_size
        if file.read(len(MAGIC)) != MAGIC:
            raise NotARecordingError(f"{path} is not an MCAP file")
        return _Scanner(file, size, path).run()


def has_end(path: str | os.PathLike[str]) -> bool:
    """Whether a file ends with a summary and a footer. Raises OSError."""
    with Path(path).open("rb") as file:
        return _has_footer(file, os.fstat(file.fileno()).st_size)


def _has_footer(file: IO[bytes], size: int) -> bool:
    file.seek(max(0, size - FOOTER_LENGTH))
    data = file.read()
    if len(data) != FOOTER_LENGTH or not data.endswith(MAGIC):
        return False
    footer: Footer = Footer.read(ReadDataStream(BytesIO(data[HEAD.size :])))
    return footer.summary_start > 0


def content_of(file: IO[bytes], chunk: ChunkIndex) -> bytes:
    """The decompressed content of a chunk. Raises ValueError if it is damaged."""
    file.seek(chunk.chunk_start_offset + HEAD.size)
    try:
        record = Chunk.read(ReadDataStream(file))
        stream, length = get_chunk_data_stream(record, validate_crc=True)
        return stream.read(length)
    except Exception as error:  # each compression has exceptions of its own
        place = chunk.chunk_start_offset
        raise ValueError(f"the chunk at byte {place} is damaged: {error}") from error


def index_of(file: IO[bytes], chunk: ChunkIndex, channel: int) -> NDArray[np.uint64]:
    """The message index of a channel: (n, 2), log time [ns] and offset in the chunk."""
    file.seek(chunk.message_index_offsets[channel] + HEAD.size + 2)
    (length,) = struct.unpack("<I", file.read(4))
    return np.frombuffer(file.read(length), "<u8").reshape(-1, 2)


def messages_of(file: IO[bytes], chunk: ChunkIndex, channel: int) -> Iterator[bytes]:
    """The data of a channel's messages in a chunk, of any size. Raises ValueError."""
    content = content_of(file, chunk)
    for _, offset in index_of(file, chunk, channel):
        begin = int(offset)
        if begin + MESSAGE_HEAD.itemsize > len(content):
            raise ValueError("a message index leads out of its chunk")
        (length,) = struct.unpack_from("<Q", content, begin + 1)
        yield content[begin + MESSAGE_HEAD.itemsize : begin + LENGTH_ENDS_AT + length]


def attachment_of(file: IO[bytes], place: AttachmentIndex) -> Attachment:
    """An attachment with its data."""
    file.seek(place.offset + HEAD.size)
    attachment: Attachment = Attachment.read(ReadDataStream(file))
    return attachment


class _Scanner:
    def __init__(self, file: IO[bytes], size: int, path: str | os.PathLike[str]) -> None:
        self._file, self._size, self._path = file, size, path
        self._scan = Scan(end=len(MAGIC))
        self._chunk: ChunkIndex | None = None  # whose message indexes are being read

    def run(self) -> Scan:
        at = len(MAGIC)
        while at + HEAD.size <= self._size:
            opcode, length = HEAD.unpack(self._file.read(HEAD.size))
            after = at + HEAD.size + length
            if after > self._size:
                break
            if opcode == Opcode.DATA_END:
                self._scan.finished = _has_footer(self._file, self._size)
                break
            try:
                belongs = self._take(opcode, at, length)
            except (EndOfFile, ValueError, OverflowError, struct.error) as error:
                raise RecordingError(f"{self._path}: the record at byte {at} is damaged") from error
            if not belongs:
                break
            self._file.seek(after)
            at = after
        self._end_chunk(self._whole_at_the_end())
        return self._scan

    def _take(self, opcode: int, at: int, length: int) -> bool:
        """Notes one record. False: it does not belong here."""
        if opcode == Opcode.MESSAGE_INDEX:
            return self._take_index(at, length)
        self._end_chunk(whole=True)
        after = at + HEAD.size + length
        if opcode == Opcode.CHUNK:
            return self._begin_chunk(at, length)
        stream = ReadDataStream(BytesIO(self._file.read(length)))
        scan = self._scan
        if opcode == Opcode.HEADER:
            scan.library = Header.read(stream).library
        elif opcode == Opcode.SCHEMA:
            schema = Schema.read(stream)
            scan.schemas[schema.id] = schema
        elif opcode == Opcode.CHANNEL:
            channel = Channel.read(stream)
            scan.channels[channel.id] = channel
        elif opcode == Opcode.ATTACHMENT:
            self._take_attachment(Attachment.read(stream), at, after - at)
        elif opcode == Opcode.METADATA:
            metadata = Metadata.read(stream)
            scan.metadata.append(metadata)
            scan.metadata_places.append(MetadataIndex(at, after - at, metadata.name))
        scan.end = after
        return True

    def _take_attachment(self, attachment: Attachment, at: int, length: int) -> None:
        self._scan.attachments.append(
            AttachmentIndex(
                offset=at,
                length=length,
                log_time=attachment.log_time,
                create_time=attachment.create_time,
                data_size=len(attachment.data),
                name=attachment.name,
                media_type=attachment.media_type,
            )
        )

    # a chunk and the message indexes after it

    def _begin_chunk(self, at: int, length: int) -> bool:
        start, end, size, _crc, named = CHUNK_HEAD.unpack(self._file.read(32))
        compression = self._file.read(named).decode()
        (compressed,) = struct.unpack("<Q", self._file.read(8))
        self._chunk = ChunkIndex(
            chunk_length=HEAD.size + length,
            chunk_start_offset=at,
            compression=compression,
            compressed_size=compressed,
            message_end_time=end,
            message_index_length=0,
            message_index_offsets={},
            message_start_time=start,
            uncompressed_size=size,
        )
        self._counts: dict[int, int] = {}
        return True

    def _take_index(self, at: int, length: int) -> bool:
        if self._chunk is None:
            return False
        channel, size = struct.unpack("<HI", self._file.read(6))
        self._chunk.message_index_offsets[channel] = at
        self._chunk.message_index_length += HEAD.size + length
        self._counts[channel] = size // 16
        return True

    def _end_chunk(self, whole: bool) -> None:
        chunk, self._chunk = self._chunk, None
        if chunk is None or not whole:
            return
        self._scan.chunks.append(chunk)
        for channel, count in self._counts.items():
            self._scan.counts[channel] = self._scan.counts.get(channel, 0) + count
        self._scan.end = chunk.chunk_start_offset + chunk.chunk_length + chunk.message_index_length

    def _whole_at_the_end(self) -> bool:
        """Whether the last chunk has all its message indexes."""
        chunk = self._chunk
        if chunk is None or self._scan.finished:
            return True
        self._file.seek(chunk.chunk_start_offset + HEAD.size)
        try:
            records = breakup_chunk(Chunk.read(ReadDataStream(self._file)), validate_crc=True)
        except Exception:  # cut, or damaged
            return False
        channels = {record.channel_id for record in records if hasattr(record, "channel_id")}
        return channels == set(chunk.message_index_offsets)
