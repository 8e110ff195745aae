"""Writes an MCAP file in groups; each group is written whole or not at all.

After any death of the writer the file is readable up to the last group, and a successor continues
behind that group.
"""

import contextlib
import os
import shutil
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import lz4.frame
import zstandard
from mcap.records import (
    Attachment,
    Channel,
    Chunk,
    ChunkIndex,
    Header,
    Metadata,
    MetadataIndex,
    Schema,
)

import o80._core as _core
from o80.base.errors import InvalidArgument, RecordingError
from o80.recording.blocks import Block
from o80.recording.chunks import bytes_of
from o80.recording.locked_file import LockedFile, reserve
from o80.recording.scan import CUT, MAGIC, Scan, place_of, scan
from o80.recording.summary import end_of_file, room_for_end

PROFILE = "ros2"
JOINT_STATES = "joint_states"  #: content of the channels of joint states, in their metadata
LARGE = 1 << 18  # size above which rows and joint states do not compress better together [bytes]
_COMPRESS: dict[str, Callable[[], Callable[[bytes], bytes]]] = {
    "zstd": lambda: zstandard.ZstdCompressor(level=1).compress,
    "lz4": lambda: lz4.frame.compress,
    "none": lambda: bytes,
}


@dataclass(frozen=True)
class Form:
    """Format of written rows. Raises InvalidArgument for an unknown compression."""

    compression: str = "zstd"  #: zstd, lz4 or none
    joint_states: bool = True  #: write sensor_msgs/JointState too, for robots with joints

    def __post_init__(self) -> None:
        if self.compression not in _COMPRESS:
            raise InvalidArgument(
                f"compression must be {', '.join(_COMPRESS)}, got {self.compression!r}"
            )


USUAL = Form()


class FileWriter:
    """Writes one file. Move-only: close it once; only `finish` completes it."""

    def __init__(self, path: Path, form: Form = USUAL, *, proceed: bool = False) -> None:
        """Creates the file; with `proceed` continues it after its last whole group.

        Raises RecordingError if another process writes it, FileExistsError, NotARecordingError, or
        OSError without leaving a new file.
        """
        self.path = path
        self.form = form
        self.size = 0  #: [bytes]
        self.make_room: Callable[[int], None] = lambda length: None
        """Called before this number of bytes is written, the end of the file included."""
        self.kept = 0  #: size of the file when it was continued [bytes]
        self.found = Scan()  #: of the file as written so far: all records except messages
        self._compress = _COMPRESS[form.compression]()
        try:
            self._file = LockedFile(path, 0 if proceed else os.O_CREAT | os.O_EXCL)
        except BlockingIOError:
            raise RecordingError(
                f"{path} is being written by another recorder: end it first, or choose another name"
            ) from None
        try:
            if proceed:
                self._continue()
            else:
                self._append(_beginning())
        except BaseException:
            if not proceed:
                path.unlink(missing_ok=True)
            self._file.close()
            raise

    def _continue(self) -> None:
        begun = os.pread(self._file.descriptor, len(_beginning()), 0)
        if len(begun) < len(_beginning()) and _beginning().startswith(begun):
            os.ftruncate(self._file.descriptor, 0)  # not even the first group was whole
            self._append(_beginning())
        self.found = found = scan(self.path)
        if found.foreign:
            raise RecordingError(
                f"{self.path} was written by another program: record to another file"
            )
        self.kept = self.size = found.end
        os.ftruncate(self._file.descriptor, self.size)
        last_chunk = found.chunks[-1].chunk_start_offset if found.chunks else 0
        noted = any(each.name == CUT for each in found.metadata_places if each.offset > last_chunk)
        if found.chunks and not (found.finished or noted):
            with contextlib.suppress(OSError):  # also on a full disk it can be finished
                self.add_metadata(CUT, {})

    # ------------------------------------------------------------------ groups

    def add_schema(self, name: str, definition: str, *, encoding: str = "ros2msg") -> int:
        """Adds a message type, unless the file has it. Returns the type's number."""
        for schema in self.found.schemas.values():
            if schema.name == name and schema.data == definition.encode():
                return schema.id
        number = 1 + max(self.found.schemas, default=0)
        schema = Schema(id=number, data=definition.encode(), encoding=encoding, name=name)
        self._append(bytes_of(schema))
        self.found.schemas[number] = schema
        return number

    def add_channel(
        self, topic: str, schema: int, metadata: Mapping[str, str], *, encoding: str = "cdr"
    ) -> int:
        """Adds a channel. Returns the channel's number."""
        number = 1 + max(self.found.channels, default=0)
        channel = Channel(
            id=number,
            topic=topic,
            message_encoding=encoding,
            metadata=dict(metadata),
            schema_id=schema,
        )
        self._append(bytes_of(channel))
        self.found.channels[number] = channel
        return number

    def add_topic(self, topic: str, name: str, definition: str) -> int:
        """Adds a channel that belongs to no run, unless the file has it. Returns its number."""
        for channel in self.found.channels.values():
            if channel.topic == topic:
                return channel.id
        return self.add_channel(topic, self.add_schema(name, definition), {})

    def copy_channel(
        self, channel: Channel, schemas: Mapping[int, Schema], metadata: Mapping[str, str]
    ) -> int:
        """Copies another file's channel and schema, with new metadata. Returns the new number."""
        number, schema = 0, schemas.get(channel.schema_id)
        if schema is not None:
            text = schema.data.decode(errors="replace")
            number = self.add_schema(schema.name, text, encoding=schema.encoding)
        return self.add_channel(channel.topic, number, metadata, encoding=channel.message_encoding)

    def attach(self, name: str, media_type: str, data: bytes, time: int) -> None:
        """Adds an attachment. time: [ns] since 1970."""
        attachment = Attachment(time, time, name, media_type, data)
        record = bytes_of(attachment)
        self.found.attachments.append(place_of(attachment, self.size, len(record)))
        self._append(record)

    def add_metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Adds a metadata record."""
        metadata = Metadata(name, dict(values))
        record = bytes_of(metadata)
        self.found.metadata_places.append(MetadataIndex(self.size, len(record), name))
        self.found.metadata.append(metadata)
        self._append(record)

    def add_messages(self, blocks: Sequence[Block]) -> None:
        """Adds messages as a chunk, each channel at most once.

        Large joint states are a second chunk, so that readers of rows need not decompress them.
        If it raises OSError, nothing was added, or all but these.
        """
        for apart in (False, True):
            if chunk := [each for each in blocks if self._is_apart(each) == apart]:
                self._add_chunk(chunk)

    def _is_apart(self, block: Block) -> bool:
        texts = self.found.channels[block.channel].metadata
        return texts.get("content") == JOINT_STATES and block.records.nbytes >= LARGE

    def _add_chunk(self, blocks: list[Block]) -> None:
        content = b"".join(block.records.data for block in blocks)
        compressed = self._compress(content)
        compression = "" if self.form.compression == "none" else self.form.compression
        start = min(int(block.log_times.min()) for block in blocks)
        end = max(int(block.log_times.max()) for block in blocks)
        chunk = bytes_of(
            Chunk(compression, compressed, end, start, zlib.crc32(content), len(content))
        )
        indexes, offsets, at = b"", {}, 0
        for block in blocks:
            offsets[block.channel] = self.size + len(chunk) + len(indexes)
            indexes += block.index(at)
            at += block.records.nbytes
        index = ChunkIndex(
            chunk_length=len(chunk),
            chunk_start_offset=self.size,
            compression=compression,
            compressed_size=len(compressed),
            message_end_time=end,
            message_index_length=len(indexes),
            message_index_offsets=offsets,
            message_start_time=start,
            uncompressed_size=len(content),
        )
        self._append(chunk + indexes)
        self.found.chunks.append(index)
        for block in blocks:
            counts = self.found.counts
            counts[block.channel] = counts.get(block.channel, 0) + len(block.log_times)

    def _append(self, *pieces: bytes | bytearray, last: bool = False) -> None:
        """Writes a group whole, or restores the file and raises OSError."""
        end = self.size
        try:
            if not last:
                room = sum(map(len, pieces)) + room_for_end(self.found)
                self.make_room(room)
                reserve(self._file.descriptor, end, room)
            for piece in pieces:
                rest = memoryview(piece)
                while rest:
                    written = os.pwrite(self._file.descriptor, rest, end)
                    rest, end = rest[written:], end + written
        except OSError:
            with contextlib.suppress(OSError):
                os.ftruncate(self._file.descriptor, self.size)
            raise
        self.size = end

    # ------------------------------------------------------------------ the end

    def finish(self) -> None:
        """Writes the summary and closes the file, which any reader can then open.

        If it raises OSError, the file is closed and complete up to its last chunk.
        """
        try:
            self._append(*end_of_file(self.found, self.size), last=True)
            self.found.finished = True
        finally:
            self.close()

    def close(self) -> None:
        """Closes the file without a summary; may be called twice."""
        if self._file.descriptor >= 0:
            os.ftruncate(self._file.descriptor, self.size)  # returns reserved space
            try:
                if os.fstat(self._file.descriptor).st_nlink == 0:
                    self._write_again()
            finally:
                self._file.close()

    def moved_to(self) -> str | None:
        """Current name of the open file; "" if it was removed, None if it is still `path`."""
        is_open = os.fstat(self._file.descriptor)
        with contextlib.suppress(OSError):
            if os.path.samestat(is_open, os.stat(self.path)):
                return None
        return os.readlink(self._opened) if is_open.st_nlink else ""

    @property
    def _opened(self) -> str:
        return f"/proc/self/fd/{self._file.descriptor}"

    def _write_again(self) -> None:
        """Copies a removed file to its old name, unless another file has this name by now."""
        with (
            contextlib.suppress(FileExistsError),
            open(self._opened, "rb") as removed,
            self.path.open("xb") as again,
        ):
            shutil.copyfileobj(removed, again)


def _beginning() -> bytes:
    """Returns the bytes with which every file begins."""
    return MAGIC + bytes_of(Header(PROFILE, f"o80 {_core.version()}"))
