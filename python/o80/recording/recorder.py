"""Records segments into one file."""

import fnmatch
import math
import os
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from o80.base.errors import Error, InvalidArgument, RecordingError
from o80.frontend.segments import segments
from o80.recording.marks import Mark, add_mark
from o80.recording.output import Predecessor, next_file, opened, opened_in
from o80.recording.reader import files_of
from o80.recording.source import Source

BETWEEN_SEARCHES = 0.5  # for segments that match a pattern [s]
_BYTES = {"k": 1e3, "M": 1e6, "G": 1e9}
_SECONDS = {"s": 1.0, "min": 60.0, "h": 3600.0}


class Recorder:
    """Reads segments and writes rows and journals; `poll` does a part of the work. One thread."""

    between_chunks = 0.1
    """Longest time that `poll` should not be called [s]: what a killed recorder has not written."""

    def __init__(
        self,
        path: str | os.PathLike[str],
        names: Sequence[str],
        *,
        proceed: bool = False,
        from_now: bool = False,
        compression: str = "zstd",
        split: str | None = None,
    ) -> None:
        """names: of segments, or patterns such as "arm*". proceed: continue an existing file.
        from_now: begin with the newest rows instead of the oldest that the segments hold.

        path: ends in .mcap. split: go on in a new file after this size or time, see Split; `path`
        is a folder of files then. Raises RecordingError, InvalidArgument: then no new file is left.
        """
        if not names:
            raise InvalidArgument("give the name of at least one segment to record")
        self.path = path = Path(path)
        self._split = None if split is None else Split.of(split)
        if path.suffix != ".mcap":
            raise RecordingError(
                f"the name of a recording must end in .mcap, got '{path}': o80 plot, export and "
                f"diff know a recording by it"
            )
        self._patterns = [name for name in names if any(sign in name for sign in "*?[")]
        new = not path.exists()
        open_file = opened if self._split is None else opened_in
        self.file = open_file(path, proceed=proceed, compression=compression)
        before = [each for each in files_of(path) if each != self.file.path]
        self._bytes_before = sum(each.stat().st_size for each in before)
        self._file_begun = time.monotonic()
        self.sources: dict[str, Source] = {}
        self._search_at = 0.0
        try:
            self._before = Predecessor(self.file, before) if proceed else None
            with self.writing():
                for name in names:
                    if name not in self._patterns:
                        self._add(name, from_now)
                self._search(from_now)
        except BaseException:
            self._close_sources()
            self.file.close()
            if new:
                self.file.path.unlink(missing_ok=True)
                if path.is_dir():
                    path.rmdir()
            raise

    @property
    def size(self) -> int:
        """Size of all files so far [bytes]."""
        return self._bytes_before + self.file.size

    @property
    def rows(self) -> int:
        """Rows recorded so far."""
        return sum(source.rows for source in self.sources.values())

    @property
    def missed(self) -> int:
        """Rows that were overwritten before they were read."""
        return sum(source.missed for source in self.sources.values())

    @property
    def newest(self) -> dict[str, int]:
        """Iteration of the newest row of each segment; -1 for one that is not there."""
        return {name: source.newest for name, source in self.sources.items()}

    def poll(self) -> int:
        """Writes a chunk of what was published since the last call; returns how many messages."""
        with self.writing():
            if self._is_full():
                self._go_on_in_next_file()
            if self._patterns and time.monotonic() >= self._search_at:
                self._search()
            blocks = [block for source in self.sources.values() for block in source.poll()]
            if blocks:
                self.file.add_chunk(blocks)
            for source in self.sources.values():
                for text, iteration in source.marks:
                    mark = Mark(text, time.time_ns(), {source.name: iteration})
                    add_mark(self.file, mark, source.log_time(iteration))
                source.marks.clear()
        return sum(block.count for block in blocks)

    @contextmanager
    def writing(self) -> Iterator[None]:
        """Makes an OSError of its block a RecordingError."""
        try:
            yield
        except Error:
            raise
        except OSError as error:
            raise RecordingError(
                f"{self.file.path} cannot be written any more: {error.strerror}. What was "
                f"recorded until now is in it; make room, or record to another disk"
            ) from error

    def mark(self, name: str, /, **values: Any) -> None:
        """Writes a note with the newest iteration of each segment. Raises TypeError."""
        with self.writing():
            now, newest = time.time_ns(), self.newest
            log_times = (self.sources[each].log_time(row) for each, row in newest.items())
            add_mark(self.file, Mark(name, now, newest, values), max(log_times, default=now))

    def catch_up(self) -> None:
        """Polls until rows and decisions that were published before the call are written."""
        if not self.poll():  # attaches to robots that have just started
            return
        positions = {name: source.position for name, source in self.sources.items()}
        while not all(self.sources[name].has_read(at) for name, at in positions.items()):
            if not self.poll():
                return

    def finish(self) -> None:
        """Finishes the file: after this any MCAP reader opens it."""
        self._close_sources()
        with self.writing():
            self.file.finish()

    def _close_sources(self) -> None:
        for source in self.sources.values():
            source.close()

    def _is_full(self) -> bool:
        """Whether the next rows belong in another file."""
        if self._split is None or not self.file.found.chunks:
            return False
        return self._split.is_due(self.file.size, self._file_begun)

    def _go_on_in_next_file(self) -> None:
        """Another recorder that continues finds one of the two files locked at any moment."""
        full, self.file = self.file, next_file(self.file)
        self._file_begun = time.monotonic()
        try:
            for source in self.sources.values():
                source.go_on_in(self.file)
        finally:
            full.finish()
            self._bytes_before += full.size

    def _add(self, name: str, from_now: bool) -> None:
        written = self._before.written(name) if self._before else {}
        self.sources[name] = Source(name, self.file, written, from_now=from_now)

    def _search(self, from_now: bool = False) -> None:
        """Adds segments that match a pattern and are not recorded yet."""
        self._search_at = time.monotonic() + BETWEEN_SEARCHES
        if not self._patterns:
            return
        for segment in segments():
            matches = any(fnmatch.fnmatchcase(segment.name, each) for each in self._patterns)
            if matches and segment.readable and segment.name not in self.sources:
                self._add(segment.name, from_now)


@dataclass(frozen=True)
class Split:
    """The most that one file of a recording holds."""

    bytes: float = math.inf
    seconds: float = math.inf

    @classmethod
    def of(cls, text: str) -> "Split":
        """Split by "500M" or "2G" (bytes), "600s", "10min" or "1h". Raises InvalidArgument."""
        number = text.rstrip("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ ")
        unit = text[len(number) :].strip()
        try:
            value = float(number)
        except ValueError:
            value = 0.0
        if value > 0 and math.isfinite(value):
            if unit in _BYTES:
                return cls(bytes=value * _BYTES[unit])
            if unit in _SECONDS:
                return cls(seconds=value * _SECONDS[unit])
        raise InvalidArgument(
            f"split must be a size such as 500M or 2G, or a time such as 600s, 10min or 1h, "
            f"got '{text}'"
        )

    def is_due(self, size: int, begun: float) -> bool:
        """Whether a file of this size [bytes], begun at this monotonic time, is full."""
        return size >= self.bytes or time.monotonic() - begun >= self.seconds
