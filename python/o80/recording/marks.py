"""Marks: notes in a recording, such as the number of an episode.

The recording program writes marks with `mark`; other programs note them in the journal of a
backend (`Frontend.mark`, `o80 mark`), from which the recorder copies them.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from typing import IO, Any

import numpy as np

from o80.base.finite import json_text
from o80.base.screen import html
from o80.recording.blocks import Block
from o80.recording.cdr import CdrReader, CdrWriter
from o80.recording.file_writer import FileWriter
from o80.recording.scan import Scan, messages_of

TOPIC = "/o80/marks"
TYPE = "o80/msg/Mark"
DEFINITION = """\
string name
int64 time  # wall clock, when it was made [ns since 1970]
string[] segments
int64[] rows  # newest iteration of each of these segments then
string values  # JSON
"""


@dataclass(frozen=True)
class Mark:
    """A note by the recording program or by a frontend."""

    name: str
    time: int  #: wall-clock time of recording [ns since 1970]
    rows: Mapping[str, int]  #: newest iteration of each segment at the time of the mark
    values: Mapping[str, Any] = field(default_factory=dict)
    row_time: int = field(default=0, compare=False)  #: in a file: log time of the newest row [ns]

    def message(self) -> bytes:
        """Encodes the mark as a CDR message. Raises TypeError if a value has no form in JSON."""
        cdr = CdrWriter()
        cdr.text(self.name)
        cdr.numbers("q", self.time)
        cdr.texts([*self.rows])
        cdr.numbers("I", len(self.rows))
        if self.rows:
            cdr.numbers("q", *self.rows.values())
        cdr.text(json_text(self.values, default=_plain))
        return bytes(cdr.data)

    @classmethod
    def of(cls, message: bytes) -> "Mark":
        """Decodes CDR. Raises ValueError, TypeError, RecursionError, struct.error if damaged."""
        cdr = CdrReader(message)
        name, (time,), segments = cdr.text(), cdr.numbers("q", 1), cdr.texts()
        (count,) = cdr.numbers("I", 1)
        rows = cdr.numbers("q", count) if count else ()
        mark = cls(name, time, dict(zip(segments, rows, strict=True)), json.loads(cdr.text()))
        if not isinstance(mark.values, dict):
            raise ValueError("a mark is damaged")
        return mark


class Marks(list[Mark]):
    """The marks of a recording; a notebook shows them as a table."""

    def _repr_html_(self) -> str:
        return html(
            ("time", "mark", "rows", "values"),
            [
                (
                    datetime.fromtimestamp(each.row_time * 1e-9).isoformat(" ", "milliseconds"),
                    each.name,
                    ", ".join(f"{name} {row}" for name, row in each.rows.items()),
                    ", ".join(f"{name}={value}" for name, value in each.values.items()),
                )
                for each in self
            ],
        )


def _plain(value: Any) -> Any:
    """Converts NumPy values to plain numbers and lists, for JSON."""
    if isinstance(value, (np.generic, np.ndarray)):
        return value.tolist()
    raise TypeError(f"a mark must be a value that JSON can hold, got {value!r:.60}")


def added_marks(file: FileWriter, marks: Sequence[tuple[int, Mark]]) -> Block:
    """Makes messages of marks (at least one), each with the log time of its newest row [ns]."""
    channel = file.add_topic(TOPIC, TYPE, DEFINITION)
    return Block.of(channel, [(time, mark.message()) for time, mark in marks])


def marks_in(file: IO[bytes], found: Scan) -> list[Mark]:
    """Reads all marks of a file, in order."""
    channels = [each.id for each in found.channels.values() if each.topic == TOPIC]
    return [
        replace(Mark.of(message), row_time=row_time)
        for chunk in found.chunks.having(*channels)
        for number in channels
        if number in chunk.message_index_offsets
        for row_time, message in messages_of(file, chunk, number)
    ]


def has_marks(found: Scan) -> bool:
    """True if a scanned file holds a mark."""
    return any(
        each.topic == TOPIC and found.counts.get(each.id, 0) for each in found.channels.values()
    )
