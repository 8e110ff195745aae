"""Marks: notes of a program in a recording, such as the number of an episode."""

import json
import struct
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import IO, Any

import numpy as np

from o80.recording.blocks import MESSAGE, MESSAGE_HEAD, MESSAGE_INDEX
from o80.recording.file_writer import FileWriter
from o80.recording.scan import Scan, content_of, index_of

TOPIC = "/o80/marks"
SCHEMA = '{"type": "object", "properties": {"name": {"type": "string"}}}'


@dataclass(frozen=True)
class Mark:
    """A note of the program that recorded."""

    name: str
    time: int  #: wall clock [ns since 1970]
    rows: Mapping[str, int]  #: newest iteration of each segment when it was made
    values: Mapping[str, Any] = field(default_factory=dict)

    def message(self) -> bytes:
        """As JSON. Raises TypeError if a value has no form in JSON."""
        texts = {"name": self.name, "time": self.time, "rows": self.rows, "values": self.values}
        return json.dumps(texts, default=_plain).encode()

    @classmethod
    def of(cls, message: bytes) -> "Mark":
        return cls(**json.loads(message))


@dataclass(frozen=True)
class MarkBlock:
    """One mark in a chunk."""

    channel: int
    time: int
    message: bytes

    @property
    def content(self) -> bytes:
        length = MESSAGE_HEAD.itemsize - 9 + len(self.message)
        head = struct.pack("<BQHIQQ", MESSAGE, length, self.channel, 0, self.time, self.time)
        return head + self.message

    @property
    def count(self) -> int:
        return 1

    @property
    def time_range(self) -> tuple[int, int]:
        return self.time, self.time

    def index(self, offset: int) -> bytes:
        return struct.pack("<BQHIQQ", MESSAGE_INDEX, 22, self.channel, 16, self.time, offset)


def _plain(value: Any) -> Any:
    """Numbers and lists of what NumPy computed."""
    if isinstance(value, (np.generic, np.ndarray)):
        return value.tolist()
    raise TypeError(f"a mark holds what JSON can hold, not {type(value).__name__}: {value!r:.60}")


def add_mark(file: FileWriter, mark: Mark) -> None:
    """Writes a mark, in a chunk of its own."""
    message = mark.message()
    channel = _channel_in(file.found)
    if channel is None:
        schema = file.add_schema("o80/Mark", SCHEMA, encoding="jsonschema")
        channel = file.add_channel(TOPIC, schema, {}, encoding="json")
    file.add_chunk([MarkBlock(channel, mark.time, message)])


def marks_in(file: IO[bytes], found: Scan) -> list[Mark]:
    """All marks of a file, in their order."""
    channel = _channel_in(found)
    marks = []
    for chunk in found.chunks:
        if channel is None or channel not in chunk.message_index_offsets:
            continue
        content = content_of(file, chunk)
        for _, offset in index_of(file, chunk, channel):
            begin = int(offset)
            (length,) = struct.unpack_from("<Q", content, begin + 1)
            data = content[begin + MESSAGE_HEAD.itemsize : begin + 9 + length]
            marks.append(Mark.of(data))
    return marks


def _channel_in(found: Scan) -> int | None:
    return next((each.id for each in found.channels.values() if each.topic == TOPIC), None)
