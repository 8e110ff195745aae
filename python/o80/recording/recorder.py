"""Records segments into one file."""

import fnmatch
import math
import os
import time
import warnings
import weakref
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from o80.base.errors import Error, InvalidArgument, RecordingError
from o80.base.screen import bytes_text
from o80.frontend.segments import segments
from o80.recording.epoch import WallClock, topic_of
from o80.recording.file_writer import USUAL, Form
from o80.recording.log_channel import INFO, Line, added_lines
from o80.recording.marks import Mark, added_marks, has_marks
from o80.recording.output import Predecessor, next_file, opened, opened_in
from o80.recording.reader import files_of
from o80.recording.snapshots import interval
from o80.recording.source import Source
from o80.recording.summary import room_for_end

BETWEEN_SEARCHES = 0.5  # time between two searches for segments of a pattern [s]
FIRST_SECONDS = 5.0  # time in which chunks are short
LONGEST_CHUNK = 2.5  # [s]
_BYTES = {"k": 1e3, "M": 1e6, "G": 1e9}
_SECONDS = {"s": 1.0, "min": 60.0, "h": 3600.0}


class Recorder:
    """Reads segments and writes rows and journals, a chunk in each `poll`. For one thread."""

    between_chunks = 0.1  #: time between two checks whether a chunk is due [s]

    def __init__(
        self,
        path: str | os.PathLike[str],
        names: Sequence[str],
        *,
        proceed: bool = False,
        from_now: bool = False,
        split: str | None = None,
        keep: str | None = None,
        snapshots: float | None = None,
        form: Form = USUAL,
    ) -> None:
        """names: segments, or patterns such as "arm*". proceed: continue an existing file.
        from_now: begin with the newest rows instead of the oldest that the segments hold.

        path: ends in .mcap. split: begin a new file after this size or time, see Split; `path` is
        then a folder. keep: largest size of this folder, such as "50G": the oldest files of this
        recorder without marks are deleted. snapshots: interval of snapshot requests to simulations
        [s]. If it raises RecordingError or InvalidArgument, no new file is left.
        """
        if not names:
            raise InvalidArgument("give the name of at least one segment to record")
        self.path = path = Path(path)
        self._snapshots = None if snapshots is None else interval(snapshots)
        self._split = None if split is None else Split.of(split)
        self._keep = math.inf if keep is None else _most(keep, self._split)
        self._removable: list[tuple[Path, int]] = []  # own complete files without marks, and sizes
        if path.suffix != ".mcap":
            raise RecordingError(
                f"the name of a recording must end in .mcap, got '{path}': o80 plot, export and "
                f"diff know a recording by it"
            )
        self._patterns = [name for name in names if any(sign in name for sign in "*?[")]
        self._file_is_own = new = not path.exists()
        open_file = opened if self._split is None else opened_in
        self.file = open_file(path, form, proceed=proceed)
        before = [each for each in files_of(path) if each != self.file.path]
        self._bytes_before = sum(each.stat().st_size for each in before)
        self.file.make_room = _weakly(self._make_room)
        self._file_begun = time.monotonic()
        self.sources: dict[str, Source] = {}
        self._search_at = 0.0
        self._lost: object = None  # the file whose name was lost
        self._begun = self._polled = time.monotonic()
        self._left_out: set[str] = set()  # found, but not recorded
        try:
            self._before = Predecessor(self.file, before) if proceed else None
            self._clock = self._before.clock() if self._before else WallClock({})
            with self.writing():
                for name in names:
                    if name not in self._patterns:
                        self._add(name, from_now)
                self._search(from_now, new=True)
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
        return sum(source.rows for source in [*self.sources.values()])  # a thread may add some

    @property
    def missed(self) -> int:
        """Rows that were overwritten before they were read."""
        return sum(source.missed for source in [*self.sources.values()])

    @property
    def newest(self) -> dict[str, int]:
        """Iteration of the newest row of each segment; -1 for a segment that is not there."""
        return {name: source.newest for name, source in self.sources.items()}

    def is_due(self) -> bool:
        """True if the next chunk should be written.

        Always in the first seconds; later after `LONGEST_CHUNK`, or when a quarter of a segment is
        unread, so that the successor of a killed recorder misses nothing.
        """
        now = time.monotonic()
        if now - self._polled >= LONGEST_CHUNK or now - self._begun < FIRST_SECONDS:
            return True
        if self._patterns and now >= self._search_at:
            with self.writing():
                self._search()
        return any(each.behind or each.is_filled(0.25) for each in self.sources.values())

    def poll(self) -> int:
        """Writes rows and entries since the last call as a chunk; returns the message count."""
        self._polled = time.monotonic()
        with self.writing():
            full = self._split is not None and self._split.is_due(self.file.size, self._file_begun)
            if full and self.file.found.chunks:
                self._continue_in_next_file()
            if self._patterns and time.monotonic() >= self._search_at:
                self._search()
            blocks = [block for source in self.sources.values() for block in source.poll()]
            count = sum(len(block.log_times) for block in blocks)
            marks, lines = [], []
            for source in self.sources.values():
                for text, iteration in source.marks:
                    mark = Mark(text, time.time_ns(), {source.name: iteration})
                    marks.append((source.log_time(iteration), mark))
                lines += source.log
                source.marks.clear()
                source.log.clear()
            if marks:
                blocks.append(added_marks(self.file, marks))
            if lines:
                blocks.append(added_lines(self.file, lines))
            if blocks:
                self.file.add_messages(blocks)
            self._check_name()
        return count

    def _check_name(self) -> None:
        """Warns once if the file being written was moved or removed."""
        name = self.file.moved_to()
        if name is not None and self._lost is not self.file:
            self._lost = self.file
            where = (
                f"moved to {name}, and continues there" if name else "removed: it is written again"
            )
            end = "" if name else " to its name when it ends, and lost if its recorder is killed"
            text = f"the recording {self.file.path} was {where}{end}"
            warnings.warn(text, RuntimeWarning, stacklevel=3)

    @contextmanager
    def writing(self) -> Iterator[None]:
        """Turns an OSError of its block into a RecordingError."""
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
        """Writes a mark with the newest iterations. Raises TypeError for values without JSON."""
        with self.writing():
            now, newest = time.time_ns(), self.newest
            there = [each for each, row in newest.items() if row >= 0]
            log_times = (self.sources[each].log_time(newest[each]) for each in there)
            mark = Mark(name, now, newest, values)
            log_time = max(log_times, default=now)
            line = Line("", log_time, INFO, f"mark {name}")
            blocks = added_marks(self.file, [(log_time, mark)]), added_lines(self.file, [line])
            self.file.add_messages(blocks)

    def catch_up(self) -> None:
        """Polls until rows and decisions that were published before the call are written."""
        if not self.poll():  # attaches to robots that have just started
            return
        positions = {name: source.position for name, source in self.sources.items()}
        while not all(self.sources[name].has_read(at) for name, at in positions.items()):
            if not self.poll():
                return

    def finish(self) -> None:
        """Finishes the file, which any MCAP reader can then open."""
        self._close_sources()
        with self.writing():
            self.file.finish()

    def _close_sources(self) -> None:
        for source in self.sources.values():
            source.close()

    def _continue_in_next_file(self) -> None:
        """Switches to the next file; one of the two is always locked against other recorders."""
        full, self.file = self.file, next_file(self.file)
        self._file_begun = time.monotonic()
        not_finished = full.size + room_for_end(full.found)
        self._bytes_before += not_finished
        self.file.make_room = _weakly(self._make_room)
        try:
            for source in self.sources.values():
                source.continue_in(self.file)
        finally:
            full.finish()
            self._bytes_before += full.size - not_finished
            if self._file_is_own and not has_marks(full.found):
                self._removable.append((full.path, full.size))
            self._file_is_own = True

    def _make_room(self, length: int) -> None:
        """Deletes old files if `length` more bytes would make the folder too large."""
        while self.size + length > self._keep:
            if not self._removable:
                raise RecordingError(
                    f"{self.path} would exceed its {bytes_text(self._keep)} (keep) by "
                    f"{bytes_text(self.size + length - self._keep)}, and no file can be deleted: "
                    f"{bytes_text(self._bytes_before)} have marks or are from another recorder, "
                    f"and {self.file.path.name} is being written. It has everything up to now. "
                    f"Keep more, move files away, or split into smaller ones"
                )
            oldest, size = self._removable.pop(0)
            oldest.unlink(missing_ok=True)
            self._bytes_before -= size

    def _add(self, name: str, from_now: bool) -> None:
        """Adds a source. Raises RecordingError if another recorded segment has its topic."""
        for other in self.sources:
            if topic_of(other) == topic_of(name):
                raise RecordingError(
                    f"'{name}' and '{other}' would have one topic, {topic_of(name)}, because ROS 2 "
                    f"accepts letters, digits and underscores only: rename one, or record it to "
                    f"another file"
                )
        written = self._before.written(name) if self._before else {}
        self.sources[name] = Source(
            name, self.file, written, self._clock, from_now=from_now, snapshots=self._snapshots
        )

    def _search(self, from_now: bool = False, *, new: bool = False) -> None:
        """Adds segments that match a pattern and are not recorded yet."""
        self._search_at = time.monotonic() + BETWEEN_SEARCHES
        if not self._patterns:
            return
        for segment in segments():
            matches = any(fnmatch.fnmatchcase(segment.name, each) for each in self._patterns)
            known = self.sources.keys() | self._left_out
            if matches and segment.readable and segment.name not in known:
                try:
                    self._add(segment.name, from_now)
                except RecordingError as error:
                    if new:
                        raise
                    self._left_out.add(segment.name)  # the others continue
                    warnings.warn(f"not recorded: {error}", RuntimeWarning, stacklevel=3)


def _weakly(make_room: Callable[[int], None]) -> Callable[[int], None]:
    """Avoids a reference cycle, so that a dropped recorder releases its file at once."""
    method = weakref.WeakMethod(make_room)

    def call(length: int) -> None:
        if (bound := method()) is not None:
            bound(length)

    return call


def size_of(text: str, name: str) -> float:
    """Parses a size such as "50G" [bytes]. Raises InvalidArgument, with the argument's name."""
    try:
        size = Split.of(text).bytes
    except InvalidArgument:
        size = math.inf
    if size == math.inf:
        raise InvalidArgument(f"{name} must be a size such as 50G, got '{text}'")
    return size


def _most(keep: str, split: "Split | None") -> float:
    """Parses a size such as "50G" [bytes]. Raises InvalidArgument if wrong or too small."""
    if split is None:
        raise InvalidArgument("keep needs split: it deletes whole files, such as with --split 1G")
    most = size_of(keep, "keep")
    if split.bytes < math.inf and most < 2 * split.bytes:
        raise InvalidArgument(
            f"keep must be at least twice split ({bytes_text(split.bytes)}), got '{keep}'"
        )
    return most


@dataclass(frozen=True)
class Split:
    """Largest size and duration of one file of a recording."""

    bytes: float = math.inf
    seconds: float = math.inf

    @classmethod
    def of(cls, text: str) -> "Split":
        """Parses "500M" or "2G" (bytes), "600s", "10min" or "1h". Raises InvalidArgument."""
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
        """True if a file of this size [bytes], begun at this monotonic time, is full."""
        return size >= self.bytes or time.monotonic() - begun >= self.seconds
