"""Reads a recording: the same histories and journals as from a live frontend."""

import os
from bisect import bisect
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from o80.base.cached import cached
from o80.base.errors import InvalidArgument, RecordingError
from o80.recording.epoch_part import UNFINISHED, EpochPart, parts_of
from o80.recording.foreign_file import copied
from o80.recording.marks import Mark, Marks, marks_in
from o80.recording.recorded_epoch import Histories, RecordedEpoch
from o80.recording.scan import DAMAGED, MAGIC, NotARecordingError, Scan, scan, unreadable


class RecordingFile:
    """A recording that was opened with `o80.open`: a mapping from names to its segments.

    A truncated file (its recorder was killed, or still runs) is read up to its last whole chunk.
    A folder of files, which a recorder with `split` writes, is read as one recording.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = Path(path)
        self.scans = [*_scans_of(self.path)]  #: files of the recording and their contents, in order
        parts: dict[str, dict[tuple[int, int], list[EpochPart]]] = {}
        for file, found in self.scans:
            for part in parts_of(file, found):
                epochs = parts.setdefault(part.note.segment, {})
                epochs.setdefault((part.note.number, part.note.epoch), []).append(part)
        self.segments: dict[str, RecordedSegment] = {
            name: RecordedSegment(name, [*_epochs_of([*epochs.values()], self._cut_at)])
            for name, epochs in parts.items()
        }

    @property
    def _cut_at(self) -> Path | None:
        """Returns the last file with rows, if the recorder was killed as it began the next file."""
        files = in_order(self.path) if self.path.is_dir() else []
        begun = [file for file, found in self.scans if found.channels]
        return begun[-1] if begun and files and begun[-1] != files[-1] else None

    @property
    def finished(self) -> bool:
        """True if the recorder ended in order; else `o80 repair` completes the file for others."""
        return all(found.finished for _, found in self.scans)

    @property
    def time_range(self) -> tuple[int, int]:
        """First and last wall-clock time [ns since 1970]. Raises RecordingError if it is empty."""
        files = [found.chunks for _, found in self.scans if found.chunks]
        if not files:
            raise RecordingError(f"{self.path} has no message")
        return min(chunks.start for chunks in files), max(chunks.end for chunks in files)

    @property
    def size(self) -> int:
        """Size of all files [bytes]."""
        return sum(size_of(path) for path, _ in self.scans)

    @cached
    def marks(self) -> list[Mark]:
        """Marks in the recording, in order. Raises RecordingError if a file is damaged."""
        marks = Marks()
        for path, found in self.scans:
            try:
                with found.opened(path) as file:
                    marks += marks_in(file, found)
            except OSError as error:
                raise RecordingError(unreadable(path, error)) from error
            except (*DAMAGED, TypeError, RecursionError) as error:
                raise RecordingError(f"{path}: {error}") from error
        return marks

    def marks_by_run(self, name: str) -> list[list[Mark]]:
        """Returns the marks of a segment, one list for each run."""
        epochs = self.segments[name].epochs
        begins = [epoch.recorded_at for epoch in epochs]
        runs: list[list[Mark]] = [[] for _ in epochs]
        for mark in self.marks:
            if name in mark.rows:
                runs[max(bisect(begins, mark.time) - 1, 0)].append(mark)
        return runs

    def runs(self, names: Iterable[str] | None = None) -> Iterator[tuple[str, int, RecordedEpoch]]:
        """Yields segment, number and epoch of each run of these segments, or of all."""
        for name in self.chosen(names):
            for number, epoch in enumerate(self.segments[name].epochs):
                yield name, number, epoch

    def chosen(self, names: Iterable[str] | None = None) -> list[str]:
        """Returns these segments, or all. Raises InvalidArgument for a segment that is missing."""
        for name in names or ():
            if name not in self.segments:
                there = ", ".join(self.segments) or "none"
                raise InvalidArgument(f"no segment '{name}' in {self.path}; there are: {there}")
        return [*(names or self.segments)]

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

    Raises RecordingError if it does not exist or is damaged.
    """
    return RecordingFile(path)


def files_of(path: Path) -> list[Path]:
    """Returns the files of a recording in order. Raises RecordingError for a folder without any.

    Leaves out a file that a killed recorder had only begun to create.
    """
    if not path.is_dir():
        return [path]
    there = in_order(path)
    if any(file.is_dir() for file in there):
        raise RecordingError(
            f"{path} is a folder of several recordings: `o80 recordings {path}` lists them"
        )
    files = [file for file in there if size_of(file) >= len(MAGIC)]
    if not files:
        raise RecordingError(f"the folder {path} holds no recording (NAME.mcap)")
    return files


def in_order(folder: Path) -> list[Path]:
    """Returns the files NAME.mcap of a folder by name; numbered files by number, last."""
    return sorted(
        folder.glob("*.mcap"),
        key=lambda file: (int(file.stem) if file.stem.isdecimal() else -1, file.name),
    )


def size_of(path: Path) -> int:
    """Returns the size of a file [bytes]; 0 if its recorder (keep) has deleted it meanwhile."""
    try:
        return path.stat().st_size
    except FileNotFoundError:
        return 0


def _scans_of(path: Path) -> Iterator[tuple[Path, Scan]]:
    """Scans the files of a recording, except files that its recorder (keep) deletes meanwhile."""
    for file in files_of(path):
        try:
            yield file, _scanned(file)
        except RecordingError:
            if file == path or file.exists():
                raise


def _scanned(path: Path) -> Scan:
    with errors_explained(path):
        found = scan(path)
        return copied(path) if found.foreign else found


@contextmanager
def errors_explained(path: Path) -> Iterator[None]:
    """Turns errors of a scan into RecordingError, with advice."""
    try:
        yield
    except NotARecordingError as error:
        raise RecordingError(f"{error}: o80.open reads files of o80 record") from None
    except FileNotFoundError:
        name, file = (path.name, path) if path.suffix == ".mcap" else (str(path), f"{path}.mcap")
        segment = name.removesuffix(".mcap")
        raise RecordingError(
            f"there is no file {path}: give a recording. `o80 record {segment} -o {file}` records "
            f"a segment '{segment}'"
        ) from None
    except OSError as error:
        raise RecordingError(unreadable(path, error)) from error


def _epochs_of(runs: list[list[EpochPart]], cut_at: Path | None) -> Iterator[RecordedEpoch]:
    for i, parts in enumerate(runs):
        after = "a later run follows" if i + 1 < len(runs) else ""
        killed = UNFINISHED if parts[-1].path == cut_at else ""
        yield RecordedEpoch(parts, after or killed)


class RecordedSegment(Histories):
    """The rows of one segment: one epoch for each run of its backend."""

    def __init__(self, name: str, epochs: list[RecordedEpoch]) -> None:
        self.name = name
        self.epochs = epochs

    @property
    def _run(self) -> RecordedEpoch:
        if len(self.epochs) != 1:
            raise InvalidArgument(
                f"segment '{self.name}' has {len(self.epochs)} epochs, because its robot was "
                f"restarted: choose one, for example recording['{self.name}'].epochs[-1]"
            )
        return self.epochs[0]

    @property
    def schema(self) -> dict[str, Any]:
        """Description of the robot in its last run."""
        return self.epochs[-1].schema

    def __repr__(self) -> str:
        return f"<segment {self.name}: {len(self.epochs)} epochs>"
