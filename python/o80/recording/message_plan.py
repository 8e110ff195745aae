"""Conversion of rows to CDR messages and back, many at once.

CDR (the encoding of ROS 2 messages) has only the gaps that alignment needs, and its structs have no
alignment of their own. So the offset of each number in a message is fixed for a robot. A plan lists
where each range of bytes of a row goes; numbers that are adjacent in row and message are copied
together.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from o80.recording.cdr import ENCAPSULATION
from o80.recording.message_types import MessageType

Bytes = NDArray[np.uint8]


class Copy(NamedTuple):
    """A range of bytes of a row with its offset in a message."""

    row: int
    message: int
    length: int


class Mask(NamedTuple):
    """Bits of a row that become bytes of 0 or 1 in a message."""

    row: int
    message: int
    bits: int


class MessagePlan:
    """Encodes and decodes rows of one robot; both copy each adjacent range of bytes once."""

    def __init__(self, message: MessageType) -> None:
        self._at = 0
        self._masks: list[Mask] = []
        self._copies = _merged(self._walk(message, 0))
        self.size = len(ENCAPSULATION) + self._at  #: size of a message [bytes]

    def encode(self, rows: Bytes, messages: Bytes) -> None:
        """Encodes rows (n, bytes of a row) into messages (n, size), which may be a view."""
        messages[:] = 0
        messages[:, : len(ENCAPSULATION)] = np.frombuffer(ENCAPSULATION, np.uint8)
        for copy in self._copies:
            _part(messages, copy.message, copy.length)[:] = _part(rows, copy.row, copy.length)
        for mask in self._masks:
            bits = np.ascontiguousarray(rows[:, mask.row : mask.row + (mask.bits + 7) // 8])
            messages[:, mask.message : mask.message + mask.bits] = np.unpackbits(
                bits, axis=1, count=mask.bits, bitorder="little"
            )

    def decode(self, messages: Bytes, rows: Bytes, copies: list[Copy] | None = None) -> None:
        """Decodes messages (n, size) into rows (n, bytes of a row), without their padding.

        copies: from `packed`, for rows of only these numbers. Raises ValueError for another size.
        """
        if messages.shape[1] != self.size:
            raise ValueError(f"a row has {messages.shape[1]} bytes, not {self.size} as described")
        for copy in self._copies if copies is None else copies:
            _part(rows, copy.row, copy.length)[:] = _part(messages, copy.message, copy.length)
        for mask in self._masks if copies is None else ():
            size = (mask.bits + 7) // 8
            bits = np.zeros((len(messages), 8 * size), np.uint8)
            bits[:, : mask.bits] = messages[:, mask.message : mask.message + mask.bits]
            packed = np.packbits(bits, bitorder="little")  # faster than by row
            rows[:, mask.row : mask.row + size] = packed.reshape(len(messages), size)

    def packed(self, parts: NDArray[np.uint64]) -> list[Copy]:
        """Plans rows that hold only some numbers. parts: of `o80.rows.columns.Packing`."""
        return [
            Copy(place + begin - row, copy.message + begin - copy.row, end - begin)
            for row, size, place in parts.tolist()
            for copy in self._copies
            if (begin := max(row, copy.row)) < (end := min(row + size, copy.row + copy.length))
        ]

    # message type => copies, in the order of the message

    def _walk(self, message: MessageType, row: int) -> Iterator[Copy]:
        for member in message.members:
            place = row + member.offset
            if member.bits:
                assert member.count is not None
                self._masks.append(Mask(place, self._reserve(1, member.count), member.count))
            elif member.type is not None:
                for i in range(1 if member.count is None else member.count):
                    yield from self._walk(member.type, place + i * member.size)
            else:
                length = member.size * (1 if member.count is None else member.count)
                if length:
                    yield Copy(place, self._reserve(member.size, length), length)

    def _reserve(self, alignment: int, length: int) -> int:
        """Reserves `length` aligned bytes of a message and returns their offset."""
        begin = -(-self._at // alignment) * alignment
        self._at = begin + length
        return len(ENCAPSULATION) + begin


def _part(rows: Bytes, at: int, length: int) -> NDArray[np.void]:
    """Returns bytes of each row as one item (n, 1), which NumPy copies faster."""
    return rows[:, at : at + length].view(np.dtype((np.void, length)))


def _merged(copies: Iterator[Copy]) -> list[Copy]:
    """Joins copies that are adjacent in both row and message."""
    result: list[Copy] = []
    for copy in copies:
        if result:
            last = result[-1]
            row, message = last.row + last.length, last.message + last.length
            if (row, message) == (copy.row, copy.message):
                result[-1] = Copy(last.row, last.message, last.length + copy.length)
                continue
        result.append(copy)
    return result
