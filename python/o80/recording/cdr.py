"""Messages in CDR, the encoding of ROS 2, one at a time."""

import struct
from collections.abc import Sequence

ENCAPSULATION = b"\x00\x01\x00\x00"  #: first bytes of a message: CDR, little endian


class CdrWriter:
    """Appends values to a message; each is aligned to its own size, from the first value on."""

    def __init__(self) -> None:
        self.data = bytearray(ENCAPSULATION)

    def numbers(self, kind: str, *values: float) -> int:
        """Appends numbers of one format of `struct`; returns their offset in the message."""
        size = struct.calcsize(kind)
        self.data += bytes((len(ENCAPSULATION) - len(self.data)) % size)
        place = len(self.data)
        self.data += struct.pack(f"<{len(values)}{kind}", *values)
        return place

    def text(self, text: str) -> None:
        encoded = text.encode(errors="replace") + b"\0"
        self.numbers("I", len(encoded))
        self.data += encoded

    def texts(self, texts: Sequence[str]) -> None:
        """Appends a sequence of texts."""
        self.numbers("I", len(texts))
        for text in texts:
            self.text(text)

    def stamp(self, time: int) -> int:
        """Appends a builtin_interfaces/Time [ns]; returns its offset."""
        seconds, nanoseconds = divmod(time, 1_000_000_000)
        return self.numbers("I", seconds, nanoseconds)


class CdrReader:
    """Reads values from a message. Raises struct.error or ValueError if the message is damaged."""

    def __init__(self, message: bytes) -> None:
        self._message, self._at = message, len(ENCAPSULATION)

    def numbers(self, kind: str, count: int) -> tuple[int, ...]:
        self._at += (len(ENCAPSULATION) - self._at) % struct.calcsize(kind)
        values = struct.unpack_from(f"<{count}{kind}", self._message, self._at)
        self._at += count * struct.calcsize(kind)
        return values

    def text(self) -> str:
        (length,) = self.numbers("I", 1)
        begin, self._at = self._at, self._at + length
        if length == 0 or self._at > len(self._message):
            raise ValueError("a text of a message is cut")
        return self._message[begin : self._at - 1].decode()

    def texts(self) -> list[str]:
        (count,) = self.numbers("I", 1)
        return [self.text() for _ in range(count)]
