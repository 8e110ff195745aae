"""The recordings below a folder, with an index that makes the next search quick.

The index is a SQLite file in the folder. It is only a copy: if it is damaged or missing, it is made
anew. A recording is read again if its size or its time of change differs.
"""

import contextlib
import json
import os
import sqlite3
import struct
import warnings
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from datetime import datetime
from pathlib import Path

from o80.base.errors import InvalidArgument, RecordingError
from o80.base.finite import json_text
from o80.recording.reader import RecordingFile
from o80.recording.recorded_epoch import RecordedEpoch

INDEX = ".o80-recordings.sqlite"
VERSION = 2  # version of the index
MARKS = 200  # most marks that the index keeps of each recording
_DAMAGED = (RecordingError, OSError, ValueError, LookupError, TypeError, struct.error)

Progress = Callable[[int, int], None]
Stamp = tuple[int, int]  # size [bytes] and time of the last change [ns]


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

    A recording that cannot be read has a `problem`. Writes the index `.o80-recordings.sqlite` into
    the folder, which makes the next call quick; warns (RuntimeWarning) where that is not possible.
    Raises InvalidArgument if there is no such folder.
    """
    root = Path(folder)
    if not root.is_dir() or root.suffix == ".mcap":
        raise InvalidArgument(f"{root} is not a folder of recordings")
    known = _read(root)
    there = dict(_stamps(root))
    new = [name for name, stamp in there.items() if name not in known or known[name][0] != stamp]
    texts = {}
    for number, name in enumerate(new, 1):
        texts[name] = _summary(root / name)
        known[name] = there[name], _found(root / name, there[name], texts[name])
        if progress is not None:
            progress(number, len(new))
    gone = known.keys() - there.keys()
    if new or gone:
        kept = (name for name in new if not known[name][1].problem or _is_readable(root / name))
        _write(root, [(name, *there[name], texts[name]) for name in kept], gone)
    first = 0 if begin is None else _nanoseconds(begin)
    last = 2**63 if end is None else _nanoseconds(end)
    chosen = [
        each
        for each in (known[name][1] for name in sorted(there))
        if each.has(text) and (each.problem or (each.begin <= last and each.end >= first))
    ]
    return sorted(chosen, key=lambda each: each.begin)


def _nanoseconds(time: datetime) -> int:
    """Converts to ns since 1970, clamped for years outside the range of `timestamp()`."""
    try:
        return int(time.timestamp() * 1e9)
    except (ValueError, OverflowError):
        return 0 if time.year < 1970 else 2**63


def _stamps(root: Path) -> Iterator[tuple[str, Stamp]]:
    """Yields path below the root and stamp of each recording; a folder NAME.mcap counts as one."""
    waiting = [root]
    while waiting:
        folder = waiting.pop()
        try:
            entries = [*os.scandir(folder)]
        except OSError as error:
            warnings.warn(
                f"{folder} cannot be read ({error.strerror}): what it holds is not listed",
                RuntimeWarning,
                stacklevel=3,
            )
            continue
        for entry in entries:
            with contextlib.suppress(OSError):  # removed meanwhile
                name = str(Path(entry.path).relative_to(root))
                if not entry.name.endswith(".mcap"):
                    if entry.is_dir(follow_symlinks=False):  # links may form a circle
                        waiting.append(Path(entry.path))
                elif entry.is_dir():
                    files = [*_statuses(entry)]
                    changed = max((each.st_mtime_ns for each in files), default=0)
                    yield name, (sum(each.st_size for each in files), changed + len(files))
                elif entry.is_file():  # reading a pipe could last for ever
                    status = entry.stat()
                    yield name, (status.st_size, status.st_mtime_ns)


def _statuses(folder: os.DirEntry[str]) -> Iterator[os.stat_result]:
    """Yields the status of each file, except files that a recorder (keep) deletes meanwhile."""
    for each in os.scandir(folder):
        with contextlib.suppress(FileNotFoundError):
            yield each.stat()


def _is_readable(path: Path) -> bool:
    """Whether this user may read a recording; if not, its problem is not stored for others."""
    return all(os.access(each, os.R_OK) for each in (path, *path.glob("*")))


def _summary(path: Path) -> str:
    """Reads a recording and returns its contents as JSON."""
    try:
        recording = RecordingFile(path)
        runs = [
            asdict(run_found(name, number, epoch))
            for name in recording
            for number, epoch in enumerate(recording[name].epochs)
        ]
        every = recording.marks
        skipped = max(len(every) - MARKS, 0)
        marks = [
            (mark.name, mark.row_time, json_text(mark.values)[:1000])
            for mark in (every[: MARKS // 2] + every[MARKS // 2 + skipped :])
        ]
        found = {"finished": recording.finished, "runs": runs, "marks": marks}
        return json_text(found | {"mark_count": len(every), "problem": ""})
    except _DAMAGED as error:
        nothing = {"finished": False, "runs": [], "marks": [], "mark_count": 0}
        return json_text(nothing | {"problem": str(error) or repr(error)})


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


def _found(path: Path, stamp: Stamp, text: str) -> FoundRecording:
    read = json.loads(text)
    return FoundRecording(
        path=path,
        size=stamp[0],
        problem=read["problem"],
        finished=read["finished"],
        runs=tuple(FoundRun(**run) for run in read["runs"]),
        marks=tuple((name, time, values) for name, time, values in read["marks"]),
        mark_count=read["mark_count"],
    )


# ---------------------------------------------------------------------- the index


def _read(root: Path) -> dict[str, tuple[Stamp, FoundRecording]]:
    """Reads the index, by path; removes an index of another version or a damaged one."""
    index = root / INDEX
    if not index.exists():
        return {}
    try:
        place = f"{index.absolute().as_uri()}?mode=ro"
        with contextlib.closing(sqlite3.connect(place, uri=True)) as db:
            (version,) = db.execute("PRAGMA user_version").fetchone()
            if version != VERSION:
                raise ValueError("another version")
            return {
                os.fsdecode(name): (
                    (size, changed),
                    _found(root / os.fsdecode(name), (size, changed), text),
                )
                for name, size, changed, text in db.execute("SELECT * FROM recordings")
            }
    except (sqlite3.Error, ValueError, TypeError, LookupError):
        for path in (index, index.with_name(f"{INDEX}-journal")):
            with contextlib.suppress(OSError):
                path.unlink(missing_ok=True)
        return {}


def _write(root: Path, new: list[tuple[str, int, int, str]], gone: set[str]) -> None:
    try:
        with contextlib.closing(sqlite3.connect(root / INDEX)) as db, db:
            db.execute("PRAGMA synchronous = OFF")  # a lost index can be built again
            db.execute(f"PRAGMA user_version = {VERSION}")
            db.execute(
                "CREATE TABLE IF NOT EXISTS recordings"
                "(name BLOB PRIMARY KEY, size INTEGER, changed INTEGER, found TEXT)"
            )
            rows = ((os.fsencode(name), *rest) for name, *rest in new)  # names may be any bytes
            db.executemany("INSERT OR REPLACE INTO recordings VALUES (?, ?, ?, ?)", rows)
            names = ((os.fsencode(name),) for name in gone)
            db.executemany("DELETE FROM recordings WHERE name = ?", names)
    except sqlite3.Error as error:
        warnings.warn(
            f"{root / INDEX} cannot be written ({error}): the next call reads these recordings "
            f"again",
            RuntimeWarning,
            stacklevel=3,
        )
