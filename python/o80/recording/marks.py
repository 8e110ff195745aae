"""Marks: notes in a recording, such as the number of an episode.

A program that records writes them with `mark`; others note them in the journal of a backend
(`Frontend.mark`, `o80 mark`), from which the recorder takes them.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime
from typing import IO, Any

import numpy as np

from o80.base.screen import html
from o80.recording.blocks import SingleMessage
from o80.recording.file_writer import FileWriter
from o80.recording.scan import Scan, messages_of

TOPIC = "/o80/marks"
SCHEMA = '{"type": "object", "properties": {"name": {"type": "string"}}}'


@dataclass(frozen=True)
class Mark:
    """A note of the program that recorded, or of a frontend."""

    name: str
    time: int  #: wall clock, when it was recorded [ns since 1970]
    rows: Mapping[str, int]  #: newest iteration of each segment when it was made
    values: Mapping[str, Any] = field(default_factory=dict)

    def message(self) -> bytes:
        """As JSON. Raises TypeError if a value has no form in JSON."""
        texts = {"name": self.name, "time": self.time, "rows": self.rows, "values": self.values}
        return json.dumps(texts, default=_plain).encode()

    @classmethod
    def of(cls, message: bytes) -> "Mark":
        """Raises ValueError, TypeError, RecursionError if it is damaged."""
        mark = cls(**json.loads(message))
        is_whole = (
            isinstance(mark.name, str)
            and isinstance(mark.time, int)
            and isinstance(mark.values, dict)
            and isinstance(mark.rows, dict)
            and all(isinstance(row, int) for row in mark.rows.values())
        )
        if not is_whole:
            raise ValueError("a mark is damaged")
        return mark


class Marks(list[Mark]):
    """The marks of a recording, in a notebook as a table."""

    def _repr_html_(self) -> str:
        return html(
            ("time", "mark", "rows", "values"),
            [
                (
                    datetime.fromtimestamp(each.time * 1e-9).isoformat(" ", "milliseconds"),
                    each.name,
                    ", ".join(f"{name} {row}" for name, row in each.rows.items()),
                    ", ".join(f"{name}={value}" for name, value in each.values.items()),
                )
                for each in self
            ],
        )


def _plain(value: Any) -> Any:
    """Numbers and lists of what NumPy computed."""
    if isinstance(value, (np.generic, np.ndarray)):
        return value.tolist()
    raise TypeError(f"a mark must be a value that JSON can hold, got {value!r:.60}")


def add_mark(file: FileWriter, mark: Mark, log_time: int) -> None:
    """Writes a mark, in a chunk of its own. log_time: that of its newest row [ns]."""
    message = mark.message()
    channel = _channel_in(file.found)
    if channel is None:
        schema = file.add_schema("o80/Mark", SCHEMA, encoding="jsonschema")
        channel = file.add_channel(TOPIC, schema, {}, encoding="json")
    file.add_chunk([SingleMessage(channel, log_time, message)])


def marks_in(file: IO[bytes], found: Scan) -> list[Mark]:
    """All marks of a file, in their order."""
    channel = _channel_in(found)
    return [
        Mark.of(message)
        for chunk in found.chunks
        if channel is not None and channel in chunk.message_index_offsets
        for message in messages_of(file, chunk, channel)
    ]


def _channel_in(found: Scan) -> int | None:
    return next((each.id for each in found.channels.values() if each.topic == TOPIC), None)
