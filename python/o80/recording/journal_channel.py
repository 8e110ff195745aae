"""The journal of a backend in a recording: a channel whose messages hold its entries as bytes.

The metadata of the channel name the version of the format (src/runtime/journal/journal_format.hpp).
`_core.RawJournal` encodes the entries, `_core.RecordedJournal` decodes them.
"""

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from typing import IO

import o80._core as _core
from o80.frontend.frontend import Frontend
from o80.recording.cdr import ENCAPSULATION
from o80.recording.epoch import EpochNote, topic_of
from o80.recording.file_writer import FileWriter
from o80.recording.scan import Scan, messages_of

TYPE = "o80/msg/Journal"
DEFINITION = """\
uint64 first  # number of the first entry
uint64 next  # number after the last entry
uint8[] entries  # o80.open decodes them
"""
CONTENT = "journal"  #: name of this content in the metadata of the channel
CODEC = "codec"  #: metadata key of the version of the format
GAP = "o80.journal_gap"
"""Name of the metadata records of entries that were overwritten before they were read."""
MOST = 4 << 20  # largest size of one read [bytes]
_HEAD = struct.Struct("<4sQQI")  # encapsulation, first, next, number of bytes


@dataclass(frozen=True)
class Entries:
    """Consecutive entries of a journal."""

    first: int  #: number of the first entry
    next: int  #: number after the last one
    content: bytes
    codec: int = _core.JOURNAL_CODEC  #: version of the format of `content`

    def message(self) -> bytes:
        """Encodes the entries as a CDR message."""
        head = _HEAD.pack(ENCAPSULATION, self.first, self.next, len(self.content))
        return head + self.content

    @classmethod
    def of(cls, message: bytes, codec: int) -> "Entries":
        """Decodes a CDR message. Raises ValueError if it is damaged."""
        content = message[_HEAD.size :]
        if len(message) >= _HEAD.size:
            _, first, end, length = _HEAD.unpack_from(message)
            if len(content) == length:
                return cls(first, end, content, codec)
        raise ValueError("a message of the journal is damaged")


class JournalRecorder:
    """Reads the journal of one backend and makes messages from its entries."""

    def __init__(self, frontend: "Frontend", channel: int | None, first: int) -> None:
        """first: number of the first entry to read, if it is still there; 0: the oldest."""
        self.channel = channel
        self.begin = 0  #: number of the first entry; 0 if a journal is continued
        self.drained = False  #: nothing was left at the last read
        self.marks: list[tuple[str, int]] = []  #: text and iteration, in the last read
        self.notable = False  #: the last read has more than batches, bursts and ends of commands
        self._core = _core.RawJournal(frontend, first)
        self.exists = self._core.exists  #: the backend was started with a journal
        self._next = first if first > 0 else None  # None: begins with the oldest entry

    @property
    def unread(self) -> float:
        """Unread share of the ring, from 0 to 1."""
        return self._core.unread

    def add_channel(self, file: "FileWriter", note: EpochNote) -> None:
        """Adds a channel for the next entries to a file."""
        schema = file.add_schema(TYPE, DEFINITION)
        self.channel = file.add_channel(
            topic_of(note.segment, CONTENT),
            schema,
            note.channel_texts(CONTENT) | {CODEC: str(_core.JOURNAL_CODEC)},
        )

    def read(self) -> tuple[Entries | None, tuple[int, int] | None]:
        """Returns new entries, and the first and last number of a gap before them, or None."""
        content, first, end, more, self.marks, self.notable = self._core.read(MOST)
        self.drained = not more
        if not content:
            return None, None
        gap = None
        if self._next is None:
            self.begin = first
        if self._next is not None and first > self._next:
            gap = self._next, first - 1
        self._next = end
        return Entries(first, end, content), gap


def codec_of(found: Scan, channel: int) -> int:
    """Returns the format version of a file's journal. Raises ValueError if it is damaged."""
    codec = int(found.channels[channel].metadata.get(CODEC, "0"))
    if not 0 <= codec < 2**31:
        raise ValueError(f"the version of the journal's format is damaged: {codec}")
    return codec


def entries_in(
    file: IO[bytes], found: Scan, channel: int, *, newest_first: bool = False
) -> "Iterator[Entries]":
    """Yields entries of a journal, chunk by chunk. Raises ValueError for a damaged chunk."""
    codec = codec_of(found, channel)
    for chunk in found.chunks.having(channel, newest_first=newest_first):
        messages = [*messages_of(file, chunk, channel)]
        for _, message in reversed(messages) if newest_first else messages:
            yield Entries.of(message, codec)
