"""The chunks of a file, by their index: a few bytes each, as they stand in its summary."""

import struct
from array import array
from collections.abc import Iterator, Sequence
from typing import overload

from mcap.opcode import Opcode
from mcap.records import ChunkIndex

HEAD = struct.Struct("<BQ")
_BEGIN = struct.Struct("<QQQQI")  # after the head, until the offsets of message indexes
_OFFSET = struct.Struct("<HQ")
_MIDDLE = struct.Struct("<QI")
_END = struct.Struct("<QQ")


class Chunks(Sequence[ChunkIndex]):
    """In their order. A recording of days has very many: each is decoded when it is asked for."""

    def __init__(self) -> None:
        self.records = bytearray()  #: as in a summary
        self.start = 2**64 - 1  #: log time of the first message [ns]
        self.end = 0  #: log time of the last message [ns]
        self._begins = array("Q")  # of each record
        self._kinds = array("I")  # of each chunk: which channels it has
        self._numbers: dict[bytes, int] = {}  # of each kind
        self._channels: list[frozenset[int]] = []  # of each kind

    def append(self, chunk: ChunkIndex) -> None:
        """Adds what describes a chunk."""
        name, offsets = chunk.compression.encode(), chunk.message_index_offsets
        length = _BEGIN.size + _OFFSET.size * len(offsets) + _MIDDLE.size + len(name) + _END.size
        self.append_record(
            HEAD.pack(Opcode.CHUNK_INDEX, length)
            + _BEGIN.pack(
                chunk.message_start_time,
                chunk.message_end_time,
                chunk.chunk_start_offset,
                chunk.chunk_length,
                _OFFSET.size * len(offsets),
            )
            + b"".join(_OFFSET.pack(*each) for each in offsets.items())
            + _MIDDLE.pack(chunk.message_index_length, len(name))
            + name
            + _END.pack(chunk.compressed_size, chunk.uncompressed_size)
        )

    def append_record(self, record: bytes) -> None:
        """Adds a record of a summary. Raises struct.error if it is damaged."""
        start, end, _, _, size = _BEGIN.unpack_from(record, HEAD.size)
        begin = HEAD.size + _BEGIN.size
        _MIDDLE.unpack_from(record, begin + size)
        low, high = (record[begin + i : begin + size : _OFFSET.size] for i in (0, 1))
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
        """The sets of channels that chunks have."""
        return set(self._channels)

    def having(
        self, *channels: int, start: int = 0, end: int = 2**64, newest_first: bool = False
    ) -> Iterator[ChunkIndex]:
        """Chunks with a message of one of these channels, and with messages of these times [ns]."""
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

    @overload
    def __getitem__(self, number: int) -> ChunkIndex: ...
    @overload
    def __getitem__(self, number: slice) -> "list[ChunkIndex]": ...
    def __getitem__(self, number: int | slice) -> "ChunkIndex | list[ChunkIndex]":
        if isinstance(number, slice):
            return [self[each] for each in range(len(self))[number]]
        data, at = self.records, self._begins[number] + HEAD.size
        start, end, offset, length, size = _BEGIN.unpack_from(data, at)
        at += _BEGIN.size
        offsets = dict(_OFFSET.iter_unpack(data[at : at + size]))
        index_length, named = _MIDDLE.unpack_from(data, at + size)
        at += size + _MIDDLE.size
        compressed, uncompressed = _END.unpack_from(data, at + named)
        return ChunkIndex(
            chunk_length=length,
            chunk_start_offset=offset,
            compression=data[at : at + named].decode(),
            compressed_size=compressed,
            message_end_time=end,
            message_index_length=index_length,
            message_index_offsets=offsets,
            message_start_time=start,
            uncompressed_size=uncompressed,
        )
