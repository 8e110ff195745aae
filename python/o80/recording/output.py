"""Opens the files that a recorder writes: new files, or those of a predecessor to continue."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from o80.base.errors import RecordingError
from o80.base.unwritable import reason, writing
from o80.recording.epoch import EpochNote, WallClock, channels_of
from o80.recording.epoch_part import parts_of
from o80.recording.file_writer import JOINT_STATES, USUAL, FileWriter, Form
from o80.recording.reader import files_of, in_order
from o80.recording.scan import NotARecordingError, Scan, has_end, scan


@dataclass(frozen=True)
class Written:
    """State of one epoch in a recording that is continued."""

    note: EpochNote
    last: int = -1  #: iteration of the last row; -1: no row
    last_log_time: int = 0  #: [ns]
    journal_next: int = 0  #: number after the last entry of the journal
    has_journal: bool = False  #: True if any file holds a journal of the epoch
    channel: int | None = None  #: channel of the rows in the file that is written now
    journal: int | None = None  #: channel of the journal in this file
    joints: int | None = None  #: channel of the joint states in this file


def opened(path: Path, form: Form = USUAL, *, proceed: bool) -> FileWriter:
    """Creates a file or, with `proceed`, continues it. Raises RecordingError if it cannot."""
    if path.is_dir():
        raise RecordingError(
            f"{path} is a folder: give the name of a file; o80 record --continue --split continues "
            f"in the last file of a folder"
        )
    try:
        return FileWriter(path, form, proceed=proceed and path.exists())
    except FileExistsError:
        raise RecordingError(
            f"{path} exists. Choose another name, or remove it; o80 record --continue appends to it"
        ) from None
    except NotARecordingError as error:
        raise RecordingError(f"{error}: choose another name, or remove it") from None
    except OSError as error:
        raise RecordingError(f"{path} cannot be written: {reason(path, error)}") from error


def opened_in(folder: Path, form: Form = USUAL, *, proceed: bool) -> FileWriter:
    """Opens the first file of a new folder or, with `proceed`, the last file of an old one.

    Finishes the files before the last one. Raises RecordingError if it cannot write the folder.
    """
    if folder.exists() and not folder.is_dir():
        raise RecordingError(f"{folder} is a file: choose another name, or leave out --split")
    if folder.exists() and not proceed:
        raise RecordingError(
            f"{folder} exists. Choose another name, or remove it; "
            f"o80 record --continue --split appends to it"
        )
    with writing(folder, RecordingError):
        folder.mkdir(exist_ok=True)
    files = in_order(folder) or [folder / "0000.mcap"]
    last = opened(files[-1], form, proceed=True)  # locks the folder
    for file in files:
        if file != last.path and not has_end(file):
            opened(file, proceed=True).finish()
    return last


def all_files_of(path: Path) -> list[Path]:
    """Returns the files of a recording, also incomplete ones. Raises RecordingError for none."""
    there = in_order(path) if path.is_dir() else []
    return there if there and all(map(Path.is_file, there)) else files_of(path)


def next_file(file: FileWriter) -> FileWriter:
    """Creates the next file in the folder of a file. Raises OSError if that fails."""
    name = f"{int(file.path.stem) + 1:04}.mcap"
    return FileWriter(file.path.with_name(name), file.form)


class Predecessor:
    """Reads the files of a recording that is continued.

    Reads from the newest file back, each file at most once, until the newest epoch of a segment is
    known: only that epoch can continue.
    """

    def __init__(self, file: FileWriter, before: Sequence[Path]) -> None:
        """file: the last file, which is continued. before: complete files, in order."""
        self._last = file.path
        self._found = [(file.path, file.found)]  # newest first
        self._unread = list(before)

    def clock(self) -> WallClock:
        """Returns the last file's clock, for the next rows. Raises RecordingError if damaged."""
        path, found = self._found[0]
        clock = WallClock({})
        for part in parts_of(path, found):
            if part.note.boot:
                clock.offsets.setdefault(part.note.boot, part.note.wall_offset)
                clock.after = max(clock.after, part.log_times[1] if part.last_chunk else 0)
        return clock

    def written(self, segment: str) -> dict[int, Written]:
        """Returns the written part of each epoch; empty: no row. Raises RecordingError."""
        epochs: dict[int, Written] = {}
        for path, found in self._files():
            self._add(epochs, path, found, segment)
            newest = max(epochs.values(), key=lambda each: each.note.number, default=None)
            if newest and newest.last >= 0 and (newest.journal_next > 0 or not newest.has_journal):
                break  # older files hold nothing more of it
        return epochs

    def _files(self) -> Iterator[tuple[Path, Scan]]:
        yield from list(self._found)
        while self._unread:
            path = self._unread.pop()
            self._found.append((path, scan(path)))
            yield self._found[-1]

    def _add(self, epochs: dict[int, Written], path: Path, found: Scan, segment: str) -> None:
        """Adds the epochs of the next older file."""
        joints = channels_of(found, JOINT_STATES)
        for part in parts_of(path, found):
            note, journal = part.note, part.journal
            if note.segment != segment:
                continue
            own = Written(
                note,
                channel=part.channel,
                journal=journal,
                joints=joints.get((segment, note.number)),
            )
            known = epochs.get(note.epoch, own if path == self._last else Written(note))
            known = replace(known, has_journal=known.has_journal or journal is not None)
            if known.last < 0 and part.last_chunk is not None:
                known = replace(known, last=part.last_row, last_log_time=part.log_times[1])
            if known.journal_next == 0 and (last := next(part.entries(newest_first=True), None)):
                known = replace(known, journal_next=last.next)
            epochs[note.epoch] = known
