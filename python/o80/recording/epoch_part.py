"""Part of a run in one file of a recording."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO

import numpy as np
from mcap.records import AttachmentIndex, ChunkIndex
from numpy.typing import NDArray

from o80.base.errors import RecordingError
from o80.recording.blocks import messages_in
from o80.recording.epoch import EpochNote, channels_of, iteration_in
from o80.recording.journal_channel import CONTENT as JOURNAL
from o80.recording.journal_channel import Entries, entries_in
from o80.recording.scan import CUT, DAMAGED, Scan, attachment_of, content_of, index_of, unreadable

UNFINISHED = "the recorder still runs, or was killed"


@dataclass(frozen=True)
class EpochPart:
    """Reads the part of a run that one file holds."""

    path: Path
    found: Scan
    channel: int  #: channel of the rows
    note: EpochNote
    journal: int | None  #: channel of the journal

    @property
    def rows(self) -> int:
        """Number of rows."""
        return self.found.counts.get(self.channel, 0)

    def records(self, name: str, *numbers: str) -> Iterator[tuple[tuple[int, ...], dict[str, str]]]:
        """Yields this run's metadata records with a name: numbers by key, and all texts.

        Raises RecordingError for a damaged record.
        """
        run = (self.note.segment, str(self.note.number))
        for each in self.found.metadata:
            texts = each.metadata
            if each.name != name or (texts.get("segment"), texts.get("number")) != run:
                continue
            try:
                yield tuple(int(texts[number]) for number in numbers), texts
            except (KeyError, ValueError) as error:
                raise RecordingError(f"{self.path}: a record {name} is damaged") from error

    @property
    def every(self) -> int:
        """Row interval of a thinned recording: 10 keeps every tenth row, 1 keeps all."""
        text = self.found.channels[self.channel].metadata.get("every", "")
        return int(text) if text.isdecimal() else 1

    @property
    def last_row(self) -> int:
        """Iteration of the last row. There must be rows."""
        chunk = self.last_chunk
        assert chunk is not None
        return iteration_in(self.messages(chunk)[-1].tobytes())

    def index(self, chunk: ChunkIndex) -> NDArray[np.uint64]:
        """Reads log times and places of the rows in a chunk (n, 2). Raises RecordingError."""
        with self.reading() as file:
            return index_of(file, chunk, self.channel)

    def messages(self, chunk: ChunkIndex) -> NDArray[np.uint8]:
        """Decompresses the rows in a chunk: messages (n, size). Raises RecordingError."""
        with self.reading() as file:
            return messages_in(content_of(file, chunk), index_of(file, chunk, self.channel))

    @property
    def last_chunk(self) -> "ChunkIndex | None":
        """The last chunk with rows of this run, or None."""
        return next(self.found.chunks.having(self.channel, newest_first=True), None)

    @property
    def why_cut(self) -> str:
        """Why the file may lack the end of the run; empty if the recorder ended in order."""
        if not self.found.finished:
            return UNFINISHED
        last = self.last_chunk.chunk_start_offset if self.last_chunk else 0
        places = (each for each in self.found.metadata_places if each.name == CUT)
        return "the recorder was killed" if any(each.offset > last for each in places) else ""

    @property
    def log_times(self) -> tuple[int, int]:
        """Log times of the first and the last row [ns]. There must be rows."""
        first, last = next(self.found.chunks.having(self.channel)), self.last_chunk
        assert last is not None
        with self.reading():
            return int(self.index(first)[0, 0]), int(self.index(last)[-1, 0])

    @property
    def _description(self) -> AttachmentIndex | None:
        name = self.note.record("description")
        return next((each for each in self.found.attachments if each.name == name), None)

    @property
    def began_at(self) -> int:
        """Wall-clock time at which recording of the run began [ns since 1970]; 0: unknown."""
        place = self._description
        return 0 if place is None else place.create_time

    def entries(self, *, newest_first: bool = False) -> Iterator[Entries]:
        """Yields the entries of the journal as stored. Raises RecordingError if it is damaged."""
        if self.journal is not None:
            with self.reading() as file:
                yield from entries_in(file, self.found, self.journal, newest_first=newest_first)

    def table(self) -> bytes:
        """Reads the description of the robot. Raises RecordingError if it is missing or damaged."""
        place = self._description
        if place is None:
            raise RecordingError(f"{self.path} lacks the description of '{self.note.segment}'")
        with self.reading() as file:
            return attachment_of(file, place).data

    @contextmanager
    def reading(self) -> Iterator[IO[bytes]]:
        """Opens the file; turns errors in its content into RecordingError with its path."""
        try:
            with self.found.opened(self.path) as file:
                yield file
        except OSError as error:
            raise RecordingError(unreadable(self.path, error)) from error
        except DAMAGED as error:
            raise RecordingError(f"{self.path}: {str(error) or repr(error)}") from error


def parts_of(path: Path, found: Scan) -> Iterator[EpochPart]:
    """Yields the parts of runs in a file. Raises RecordingError for damaged metadata."""
    journals = channels_of(found, JOURNAL)
    for channel in found.channels.values():
        try:
            note = EpochNote.of(channel.metadata)
        except RecordingError as error:
            raise RecordingError(f"{path}: {error}") from None
        if note is not None:
            journal = journals.get((note.segment, note.number))
            yield EpochPart(path, found, channel.id, note, journal)
