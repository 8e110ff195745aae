"""Parts of an MCAP chunk: many messages of one channel as one array, or a few messages."""

import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

MESSAGE_HEAD = np.dtype(
    [
        ("opcode", "u1"),
        ("length", "<u8"),
        ("channel", "<u2"),
        ("sequence", "<u4"),
        ("log_time", "<u8"),
        ("publish_time", "<u8"),
    ]
)
"""Head before the data of a message; packed."""
LENGTH_ENDS_AT = 9  # opcode and length are not counted in a record's length
MESSAGE, MESSAGE_INDEX = 0x05, 0x07


@dataclass(frozen=True)
class Block:
    """Messages of one channel, of equal size, as records of a chunk."""

    channel: int
    log_times: NDArray[np.uint64]  #: (n,) [ns]
    records: NDArray[np.uint8]  #: (n, bytes of a record)

    @classmethod
    def reserved(
        cls, channel: int, log_times: NDArray[np.uint64], sequence: int, size: int
    ) -> "Block":
        """Makes records with heads but with empty messages of `size` bytes each."""
        records = np.empty((len(log_times), MESSAGE_HEAD.itemsize + size), np.uint8)
        heads = np.zeros(len(log_times), MESSAGE_HEAD)
        heads["opcode"] = MESSAGE
        heads["length"] = records.shape[1] - LENGTH_ENDS_AT
        heads["channel"] = channel
        heads["sequence"] = np.arange(sequence, sequence + len(log_times)) % 2**32
        heads["log_time"] = heads["publish_time"] = log_times
        records[:, : MESSAGE_HEAD.itemsize] = heads.view(np.uint8).reshape(len(heads), -1)
        return cls(channel, log_times, records)

    @property
    def messages(self) -> NDArray[np.uint8]:
        """The data of the messages (n, size), a view."""
        return self.records[:, MESSAGE_HEAD.itemsize :]

    @property
    def content(self) -> bytes:
        """All records."""
        return self.records.tobytes()

    @property
    def count(self) -> int:
        """Number of messages."""
        return len(self.records)

    @property
    def time_range(self) -> tuple[int, int]:
        """First and last log time [ns]."""
        return int(self.log_times[0]), int(self.log_times[-1])

    def index(self, offset: int) -> bytes:
        """Returns the message index of this block, which begins at `offset` in its chunk."""
        entries = np.empty((len(self.log_times), 2), "<u8")
        entries[:, 0] = self.log_times
        entries[:, 1] = offset + np.arange(len(entries)) * self.records.shape[1]
        return _index(self.channel, entries)


@dataclass(frozen=True)
class Messages:
    """A few messages of one channel, of any sizes."""

    channel: int
    messages: Sequence[tuple[int, bytes]]  #: log time [ns] and data of each; not empty

    @property
    def content(self) -> bytes:
        return b"".join(self._records())

    @property
    def count(self) -> int:
        return len(self.messages)

    @property
    def time_range(self) -> tuple[int, int]:
        times = [time for time, _ in self.messages]
        return min(times), max(times)

    def index(self, offset: int) -> bytes:
        entries = []
        for (time, _), record in zip(self.messages, self._records(), strict=True):
            entries.append((time, offset))
            offset += len(record)
        return _index(self.channel, np.array(entries, "<u8"))

    def _records(self) -> Iterator[bytes]:
        for time, data in self.messages:
            length = MESSAGE_HEAD.itemsize - LENGTH_ENDS_AT + len(data)
            yield struct.pack("<BQHIQQ", MESSAGE, length, self.channel, 0, time, time) + data


MessageBlock = Block | Messages


def _index(channel: int, entries: NDArray[np.uint64]) -> bytes:
    """Encodes the message index of a channel; entries: (n, 2), log time and offset in the chunk."""
    content = entries.tobytes()
    return struct.pack("<BQHI", MESSAGE_INDEX, 6 + len(content), channel, len(content)) + content


def stamps_of(times: NDArray[np.uint64]) -> NDArray[np.uint8]:
    """Encodes times [ns] as bytes (n, 8) of builtin_interfaces/Time."""
    parts = np.divmod(times, np.uint64(1_000_000_000))
    return np.stack(parts, axis=1).astype("<u4").view(np.uint8)


def messages_in(content: bytes, index: NDArray[np.uint64]) -> NDArray[np.uint8]:
    """Returns the data of a channel's messages in a chunk: (n, size), a view if they are adjacent.

    index: (n, 2), log time and offset of each message. Raises ValueError if the sizes of the
    messages differ or an offset is outside the chunk.
    """
    data = np.frombuffer(content, np.uint8)
    offsets = index[:, 1].astype(np.int64)
    begin = int(offsets[0])
    head = np.frombuffer(content, MESSAGE_HEAD, count=1, offset=begin)[0]
    length = int(head["length"]) + LENGTH_ENDS_AT
    if int(offsets.min()) < 0 or int(offsets.max()) + length > len(data):
        raise ValueError("a message index leads out of its chunk")
    if len(offsets) == 1 or bool(np.all(np.diff(offsets) == length)):
        records = data[begin : begin + len(offsets) * length].reshape(len(offsets), length)
    else:
        records = data[offsets[:, None] + np.arange(length)]
    lengths = records[:, 1:LENGTH_ENDS_AT]
    if not bool(np.all(lengths == lengths[0])):
        raise ValueError("messages of one channel differ in size")
    return records[:, MESSAGE_HEAD.itemsize :]
