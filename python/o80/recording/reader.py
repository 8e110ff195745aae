"""Reads a recording: the same histories as from a live frontend."""

import os
import struct
from collections.abc import Iterator
from functools import cached_property
from pathlib import Path
from typing import IO, Any

import numpy as np

from o80.errors import InvalidArgument, RecordingError, SegmentError
from o80.history import History
from o80.layout import decoder_of
from o80.recording.blocks import messages_in
from o80.recording.epoch import EpochNote
from o80.recording.marks import Mark, marks_in
from o80.recording.message_plan import MessagePlan
from o80.recording.message_types import row_type
from o80.recording.scan import (
    NotARecordingError,
    Scan,
    attachment_of,
    content_of,
    index_of,
    scan,
)
from o80.recording.source import GAP


class RecordingFile:
    """A recording that was opened with `o80.open`: its segments by name.

    A file that was cut (its recorder was killed, or still runs) is read up to its last whole chunk.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = Path(path)
        try:
            self._scan = scan(path)
        except NotARecordingError as error:
            raise RecordingError(f"{error}: o80.open reads files of o80 record") from None
        except OSError as error:
            raise RecordingError(f"{path} cannot be read: {error.strerror}") from error
        self.segments: dict[str, RecordedSegment] = {}
        for channel in self._scan.channels.values():
            note = EpochNote.of(channel.metadata)
            if note is not None:
                segment = self.segments.setdefault(note.segment, RecordedSegment(note.segment))
                segment.epochs.append(RecordedEpoch(self.path, self._scan, channel.id, note))

    @property
    def finished(self) -> bool:
        """Its recorder ended in order; else `o80 repair` completes the file for other readers."""
        return self._scan.finished

    @property
    def marks(self) -> list[Mark]:
        """The notes of the program that recorded, in their order. Raises RecordingError."""
        try:
            with self.path.open("rb") as file:
                return marks_in(file, self._scan)
        except (ValueError, TypeError, struct.error) as error:
            raise RecordingError(f"{self.path}: {error}") from error

    def __getitem__(self, name: str) -> "RecordedSegment":
        try:
            return self.segments[name]
        except KeyError:
            there = ", ".join(self.segments) or "none"
            raise KeyError(f"no segment {name!r} in {self.path}; there are: {there}") from None

    def __iter__(self) -> Iterator[str]:
        return iter(self.segments)

    def __len__(self) -> int:
        return len(self.segments)

    def __repr__(self) -> str:
        return f"<o80 recording {self.path}: {', '.join(self.segments) or 'no segment'}>"


def open(path: str | os.PathLike[str]) -> RecordingFile:
    """Opens a recording: `o80.open("run.mcap")["arm"].history(1000).observed`.

    Raises RecordingError.
    """
    return RecordingFile(path)


class RecordedSegment:
    """The rows of one segment: one epoch for each run of its backend."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.epochs: list[RecordedEpoch] = []

    def history(self, n: int | None = None, **selection: Any) -> History:
        """Rows of the only epoch; the arguments are those of `Frontend.history`.

        Raises InvalidArgument if there are several: choose one of `epochs`.
        """
        if len(self.epochs) != 1:
            raise InvalidArgument(
                f"segment '{self.name}' has {len(self.epochs)} epochs, because its robot was "
                f"restarted: choose one, for example .epochs[-1].history()"
            )
        return self.epochs[0].history(n, **selection)

    @property
    def schema(self) -> dict[str, Any]:
        """The description of the robot in its last run."""
        return self.epochs[-1].schema

    def __repr__(self) -> str:
        return f"<segment {self.name}: {len(self.epochs)} epochs>"


class RecordedEpoch:
    """The rows of one run of a backend."""

    def __init__(self, path: Path, found: Scan, channel: int, note: EpochNote) -> None:
        self._path, self._scan, self._channel, self._note = path, found, channel, note

    @property
    def epoch(self) -> int:
        """The number of the run; see `Frontend.epoch`."""
        return self._note.epoch

    @property
    def wall_offset(self) -> int:
        """Wall-clock time [ns since 1970] less row time."""
        return self._note.wall_offset

    @property
    def rows(self) -> int:
        """Number of recorded rows."""
        return self._scan.counts.get(self._channel, 0)

    @property
    def gaps(self) -> list[tuple[int, int]]:
        """First and last iteration of rows that are missing, because the recorder was too late."""
        number = str(self._note.number)
        return [
            (int(each.metadata["first"]), int(each.metadata["last"]))
            for each in self._scan.metadata
            if each.name == GAP
            and each.metadata["segment"] == self._note.segment
            and each.metadata["number"] == number
        ]

    @property
    def schema(self) -> dict[str, Any]:
        """The description of the robot."""
        schema: dict[str, Any] = self._decoder.layout.schema
        return schema

    @cached_property
    def _decoder(self) -> Any:
        for place in self._scan.attachments:
            if place.name == self._note.attachment:
                with self._path.open("rb") as file:
                    data = attachment_of(file, place).data
                try:
                    return decoder_of(data)
                except SegmentError as error:
                    raise RecordingError(
                        f"{self._path}: the description of '{self._note.segment}' is damaged"
                    ) from error
        raise RecordingError(f"{self._path} lacks the description of '{self._note.segment}'")

    def history(
        self,
        n: int | None = None,
        *,
        since: int | None = None,
        until: int | None = None,
        seconds: float | None = None,
        from_time: int | None = None,
        to_time: int | None = None,
    ) -> History:
        """Many observations at once; the arguments are those of `Frontend.history`.

        Raises RecordingError if the file is damaged there.
        """
        chosen = [
            chunk
            for chunk in self._scan.chunks
            if self._channel in chunk.message_index_offsets
            and (from_time is None or chunk.message_end_time >= from_time + self.wall_offset)
            and (to_time is None or chunk.message_start_time <= to_time + self.wall_offset)
        ]
        layout = self._decoder.layout
        plan = MessagePlan(row_type(layout), layout.size)
        with self._path.open("rb") as file:
            parts = [plan.decode(self._messages(file, chunk, plan.size)) for chunk in chosen]
        raw = np.concatenate(parts) if parts else np.empty((0, layout.size), np.uint8)
        rows = np.ascontiguousarray(raw).view(layout.row).reshape(len(raw))
        history = History(self._decoder, rows)
        return history.select(
            n, since=since, until=until, seconds=seconds, from_time=from_time, to_time=to_time
        )

    def _messages(self, file: IO[bytes], chunk: Any, size: int) -> Any:
        try:
            messages = messages_in(content_of(file, chunk), index_of(file, chunk, self._channel))
        except ValueError as error:
            raise RecordingError(f"{self._path}: {error}") from error
        if messages.shape[1] != size:
            raise RecordingError(f"{self._path}: rows of '{self._note.segment}' have another size")
        return messages

    def __repr__(self) -> str:
        return f"<epoch of {self._note.segment}: {self.rows} rows>"
