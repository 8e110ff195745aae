"""The recordings below a folder."""

import contextlib
import os
import struct
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from o80.base.errors import InvalidArgument, RecordingError
from o80.base.finite import json_text
from o80.recording.reader import RecordingFile, size_of
from o80.recording.recorded_epoch import RecordedEpoch

MARKS = 200  # most marks listed of each recording
_DAMAGED = (RecordingError, OSError, ValueError, LookupError, TypeError, struct.error)

Progress = Callable[[int, int], None]


@dataclass(frozen=True)
class FoundRun:
    """One run of a robot in a recording."""

    segment: str
    number: int  #: index among the runs of the segment in the recording
    robot: str
    begin: int  #: wall clock of the first row [ns since 1970]
    end: int  #: wall clock of the last row [ns since 1970]
    rows: int
    missing: int  #: number of missing rows, as far as it is known
    ended: str  #: as `RecordedEpoch.end`; "missing" if the end of the run is missing


@dataclass(frozen=True)
class FoundRecording:
    """Contents of a recording, as returned by `o80.recordings`."""

    path: Path
    size: int  #: [bytes]
    problem: str  #: why the recording cannot be read; empty if it can
    finished: bool  #: the recorder ended in order
    runs: tuple[FoundRun, ...]
    marks: tuple[tuple[str, int, str], ...]  #: name, wall clock [ns], JSON values; at most 200
    mark_count: int

    @property
    def begin(self) -> int:
        """Wall clock of the first row [ns since 1970]; 0: there is none."""
        return min((run.begin for run in self.runs if run.rows), default=0)

    @property
    def end(self) -> int:
        """Wall clock of the last row [ns since 1970]; 0: there is none."""
        return max((run.end for run in self.runs if run.rows), default=0)

    def has(self, text: str) -> bool:
        """True if the path, a segment, a robot or a mark contains a text; case does not matter."""
        texts = [str(self.path)]
        texts += [each for run in self.runs for each in (run.segment, run.robot)]
        texts += [each for name, _, values in self.marks for each in (name, values)]
        return any(text.casefold() in each.casefold() for each in texts)


def recordings(
    folder: str | os.PathLike[str],
    *,
    begin: datetime | None = None,
    end: datetime | None = None,
    text: str = "",
    progress: Progress | None = None,
) -> list[FoundRecording]:
    """Finds the recordings in a folder and below it, the oldest first.

    begin, end: only recordings with rows between these times. text: only recordings whose path,
        segments, robots or marks contain this text, in any case. progress: called with the numbers
        of recordings that were read and that must be read.

    A recording that cannot be read has a `problem`; warns (RuntimeWarning) of a folder that cannot
    be read. Raises InvalidArgument if there is no such folder.
    """
    root = Path(folder)
    if not root.is_dir() or root.suffix == ".mcap":
        raise InvalidArgument(f"{root} is not a folder of recordings")
    sizes = dict(_sizes(root))
    found = []
    for number, path in enumerate(sorted(sizes), 1):
        found.append(_found(path, sizes[path]))
        if progress is not None:
            progress(number, len(sizes))
    first = 0 if begin is None else _nanoseconds(begin)
    last = 2**63 if end is None else _nanoseconds(end)
    chosen = [
        each
        for each in found
        if each.has(text) and (each.problem or (each.begin <= last and each.end >= first))
    ]
    return sorted(chosen, key=lambda each: each.begin)


def _nanoseconds(time: datetime) -> int:
    """Converts to ns since 1970, clamped for years outside the range of `timestamp()`."""
    try:
        return int(time.timestamp() * 1e9)
    except (ValueError, OverflowError):
        return 0 if time.year < 1970 else 2**63


def _sizes(root: Path) -> Iterator[tuple[Path, int]]:
    """Yields path and size of each recording; a folder NAME.mcap counts as one."""
    for folder, folders, files in os.walk(root, onerror=_warn):
        for path in (Path(folder, name) for name in folders + files if name.endswith(".mcap")):
            with contextlib.suppress(OSError):  # removed meanwhile
                if path.is_dir():
                    yield path, sum(map(size_of, path.iterdir()))
                elif path.is_file():  # reading a pipe could last for ever
                    yield path, size_of(path)
        folders[:] = [name for name in folders if not name.endswith(".mcap")]


def _warn(error: OSError) -> None:
    what = f"{error.filename} cannot be read ({error.strerror}): its content is not listed"
    warnings.warn(what, RuntimeWarning, stacklevel=5)


def _found(path: Path, size: int) -> FoundRecording:
    try:
        recording = RecordingFile(path)
        runs = tuple(run_found(*run) for run in recording.runs())
        every = recording.marks
        marks = tuple(
            (mark.name, mark.row_time, json_text(mark.values)[:1000])
            for mark in every[: MARKS // 2] + every[MARKS // 2 :][-MARKS // 2 :]
        )
        return FoundRecording(path, size, "", recording.finished, runs, marks, len(every))
    except _DAMAGED as error:
        return FoundRecording(path, size, str(error) or repr(error), False, (), (), 0)


def run_found(segment: str, number: int, epoch: RecordedEpoch) -> FoundRun:
    """Makes the catalogue's entry of a run. Raises RecordingError if its rows cannot be read."""
    begin, end = epoch.time_range if epoch.rows else (0, 0)
    is_cut = any(gap.last is None for gap in epoch.gaps)
    return FoundRun(
        segment=segment,
        number=number,
        robot=epoch.schema["robot"],
        begin=begin + epoch.wall_offset,
        end=end + epoch.wall_offset,
        rows=epoch.rows,
        missing=epoch.missing,
        ended=epoch.end or ("missing" if is_cut else ""),
    )
