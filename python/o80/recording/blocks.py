"""Parts of an MCAP chunk: messages of one channel as one array of bytes."""

import struct
from collections.abc import Sequence
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
MESSAGE_STRUCT = struct.Struct("<BQHIQQ")  #: the same
LENGTH_ENDS_AT = 9  # opcode and length are not counted in a record's length
MESSAGE, MESSAGE_INDEX = 0x05, 0x07


@dataclass(frozen=True)
class Block:
    """Messages of one channel, as records of a chunk."""

    channel: int
    log_times: NDArray[np.uint64]  #: (n,) [ns]; not empty
    records: NDArray[np.uint8]  #: all bytes
    begins: NDArray[np.uint64]  #: (n,) place of each record in `records`

    @classmethod
    def reserved(
        cls, channel: int, log_times: NDArray[np.uint64], sequence: int, size: int
    ) -> tuple["Block", NDArray[np.uint8]]:
        """Makes records with empty messages of `size` bytes each; returns these, (n, size), too."""
        records = np.empty((len(log_times), MESSAGE_HEAD.itemsize + size), np.uint8)
        heads = np.zeros(len(log_times), MESSAGE_HEAD)
        heads["opcode"] = MESSAGE
        heads["length"] = records.shape[1] - LENGTH_ENDS_AT
        heads["channel"] = channel
        heads["sequence"] = np.arange(sequence, sequence + len(log_times)) % 2**32
        heads["log_time"] = heads["publish_time"] = log_times
        records[:, : MESSAGE_HEAD.itemsize] = heads.view(np.uint8).reshape(len(heads), -1)
        begins = np.arange(len(records), dtype=np.uint64) * np.uint64(records.shape[1])
        return cls(channel, log_times, records, begins), records[:, MESSAGE_HEAD.itemsize :]

    @classmethod
    def of(cls, channel: int, messages: Sequence[tuple[int, bytes]]) -> "Block":
        """Makes records of messages of any sizes: log time [ns] and data of each; not empty."""
        content, begins = bytearray(), []
        for time, data in messages:
            begins.append(len(content))
            length = MESSAGE_HEAD.itemsize - LENGTH_ENDS_AT + len(data)
            content += MESSAGE_STRUCT.pack(MESSAGE, length, channel, 0, time, time) + data
        times = np.array([time for time, _ in messages], np.uint64)
        return cls(channel, times, np.frombuffer(content, np.uint8), np.array(begins, np.uint64))

    def index(self, offset: int) -> bytes:
        """Returns the message index of this block, which begins at `offset` in its chunk."""
        entries = np.stack((self.log_times, self.begins + np.uint64(offset)), axis=1).astype("<u8")
        head = struct.pack("<BQHI", MESSAGE_INDEX, 6 + entries.nbytes, self.channel, entries.nbytes)
        return head + entries.tobytes()


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
