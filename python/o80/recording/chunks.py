"""Chunk indexes of a file, kept as the records of its summary: a few bytes each."""

import struct
from array import array
from collections.abc import Iterator
from io import BytesIO
from typing import Any

from mcap.data_stream import ReadDataStream, RecordBuilder
from mcap.records import ChunkIndex, McapRecord

HEAD = struct.Struct("<BQ")
_BEGIN = struct.Struct("<QQQQI")  # follows the head, up to the offsets of message indexes
_OFFSET = 10  # bytes of the offset of a message index, which begins with its channel


def bytes_of(*records: McapRecord) -> bytes:
    """Encodes records as in a file."""
    builder: Any = RecordBuilder()
    for record in records:
        record.write(builder)
    return bytes(builder.end())


class Chunks:
    """Chunk indexes in file order, decoded on access: a recording of days has very many."""

    def __init__(self) -> None:
        self.records = bytearray()  #: all records, as in a summary
        self.start = 2**64 - 1  #: log time of the first message [ns]
        self.end = 0  #: log time of the last message [ns]
        self._begins = array("Q")  # offset of each record
        self._kinds = array("I")  # kind of each chunk: a number for its set of channels
        self._numbers: dict[bytes, int] = {}  # kind by the channels as bytes
        self._channels: list[frozenset[int]] = []  # set of channels of each kind

    def append(self, chunk: ChunkIndex) -> None:
        """Adds the index of a chunk."""
        self.append_record(bytes_of(chunk))

    def append_record(self, record: bytes) -> None:
        """Adds a chunk index of a summary. Raises struct.error, ValueError if it is damaged."""
        start, end, _, _, size = _BEGIN.unpack_from(record, HEAD.size)
        begin = HEAD.size + _BEGIN.size
        (named,) = struct.unpack_from("<I", record, begin + size + 8)
        compression = record[begin + size + 12 : -16]
        if size % _OFFSET or len(compression) != named or not compression.isascii():
            raise ValueError("a chunk index is damaged")
        low, high = (record[begin + i : begin + size : _OFFSET] for i in (0, 1))
        kind = self._numbers.get(low + high)
        if kind is None:
            kind = self._numbers[low + high] = len(self._channels)
            self._channels.append(frozenset(a + 256 * b for a, b in zip(low, high, strict=True)))
        self._begins.append(len(self.records))
        self._kinds.append(kind)
        self.records += record
        self.start, self.end = min(self.start, start), max(self.end, end)

    @property
    def channels(self) -> set[frozenset[int]]:
        """The distinct sets of channels of all chunks."""
        return set(self._channels)

    def having(
        self, *channels: int, start: int = 0, end: int = 2**64, newest_first: bool = False
    ) -> Iterator[ChunkIndex]:
        """Yields chunks with a message of one of these channels and messages in this time [ns]."""
        wanted = {
            kind for kind, there in enumerate(self._channels) if not there.isdisjoint(channels)
        }
        numbers = range(len(self))
        for number in reversed(numbers) if newest_first else numbers:
            if self._kinds[number] in wanted:
                at = self._begins[number] + HEAD.size
                first, last = struct.unpack_from("<QQ", self.records, at)
                if last >= start and first <= end:
                    yield self[number]

    def __len__(self) -> int:
        return len(self._begins)

    def __iter__(self) -> Iterator[ChunkIndex]:
        return map(self.__getitem__, range(len(self)))

    def __getitem__(self, number: int) -> ChunkIndex:
        at = self._begins[number]
        _, length = HEAD.unpack_from(self.records, at)
        record = bytes(self.records[at + HEAD.size : at + HEAD.size + length])
        index: ChunkIndex = ChunkIndex.read(ReadDataStream(BytesIO(record)))
        return index
