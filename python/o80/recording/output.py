"""Files that a recorder writes: new ones, or those of a predecessor that are continued."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from o80.errors import RecordingError
from o80.recording import joint_states
from o80.recording.blocks import messages_in
from o80.recording.epoch import EpochNote, channels_of
from o80.recording.file_writer import FileWriter
from o80.recording.journal_channel import CONTENT as JOURNAL
from o80.recording.journal_channel import last_entry_in
from o80.recording.message_plan import ENCAPSULATION
from o80.recording.reader import RecordingFile, files_of
from o80.recording.scan import MAGIC, NotARecordingError, Scan, content_of, index_of, scan
from o80.unwritable import reason

FILES = "*.mcap"


@dataclass(frozen=True)
class Written:
    """What a recording holds of one epoch already."""

    note: EpochNote
    last: int = -1  #: iteration; -1: no row
    last_log_time: int = 0  #: [ns]
    journal_next: int = 0  #: number after the last entry of the journal
    channel: int | None = None  #: of the rows in the file that is written now
    journal: int | None = None  #: the channel of the journal there
    joints: int | None = None  #: the channel of joint states there


def opened(path: Path, *, proceed: bool, compression: str = "zstd") -> FileWriter:
    """A new file; or, to `proceed`, the one that is there. Raises RecordingError."""
    try:
        if proceed and path.exists():
            return FileWriter.continued(path, compression=compression)
        return FileWriter(path, compression=compression)
    except FileExistsError:
        raise RecordingError(
            f"{path} is a folder: give the name of a file, or --split"
            if path.is_dir()
            else f"{path} exists. Choose another name, or remove it; "
            f"o80 record --continue appends to it"
        ) from None
    except IsADirectoryError:
        raise RecordingError(
            f"{path} is a folder: give the name of a file, or --split to continue in its last file"
        ) from None
    except NotARecordingError as error:
        raise RecordingError(f"{error}: choose another name, or remove it") from None
    except OSError as error:
        raise RecordingError(f"{path} cannot be written: {reason(path, error)}") from error


def opened_in(folder: Path, *, proceed: bool, compression: str = "zstd") -> FileWriter:
    """The first file of a new folder; or, to `proceed`, the last one there.

    The files before it are finished. Raises RecordingError.
    """
    if folder.exists() and not folder.is_dir():
        raise RecordingError(f"{folder} is a file: choose another name, or leave out --split")
    if folder.exists() and not proceed:
        raise RecordingError(
            f"{folder} exists. Choose another name, or remove it; "
            f"o80 record --continue --split appends to it"
        )
    try:
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise RecordingError(f"{folder} cannot be written: {reason(folder, error)}") from error
    files = sorted(folder.glob(FILES)) or [folder / "0000.mcap"]
    last = opened(files[-1], proceed=True, compression=compression)  # locks the folder
    for file in unfinished_in(folder):
        if file != last.path:
            opened(file, proceed=True).finish()
    return last


def unfinished_in(path: Path) -> list[Path]:
    """The files of a recording that were cut. Raises RecordingError."""
    begun = [] if not path.is_dir() else [file for file in path.glob(FILES) if not _has_begun(file)]
    cut = [file for file in files_of(path) if not RecordingFile(file).finished]
    return sorted(begun + cut)


def _has_begun(file: Path) -> bool:
    return file.stat().st_size >= len(MAGIC)


def next_file(file: FileWriter) -> FileWriter:
    """The next file in the folder of a file. Raises OSError."""
    name = f"{int(file.path.stem) + 1:04}.mcap"
    return FileWriter(file.path.with_name(name), compression=file.compression)


def written_in(file: FileWriter, before: Sequence[Path]) -> dict[str, dict[int, Written]]:
    """What a file and those before it hold, by segment and epoch. Raises RecordingError."""
    result: dict[str, dict[int, Written]] = {}
    for path in before:
        _add(result, path, scan(path), is_last=False)
    _add(result, file.path, file.found, is_last=True)
    return result


def _add(result: dict[str, dict[int, Written]], path: Path, found: Scan, *, is_last: bool) -> None:
    journals = channels_of(found, JOURNAL)
    joints = channels_of(found, joint_states.CONTENT)
    for channel in found.channels.values():
        note = EpochNote.of(channel.metadata)
        if note is None:
            continue
        epochs = result.setdefault(note.segment, {})
        written = epochs.setdefault(note.epoch, Written(note))
        journal = journals.get((note.segment, note.number))
        last = _last_row(path, found, channel.id)
        if last is not None:
            written = replace(written, last=last[0], last_log_time=last[1])
        if journal is not None:
            entry = _last_entry(path, found, journal)
            written = replace(written, journal_next=max(entry, written.journal_next))
        if is_last:
            own = joints.get((note.segment, note.number))
            written = replace(written, channel=channel.id, journal=journal, joints=own)
        epochs[note.epoch] = written


def _last_row(path: Path, found: Scan, channel: int) -> tuple[int, int] | None:
    """Iteration and log time of the last row of a channel."""
    for chunk in reversed(found.chunks):
        if channel in chunk.message_index_offsets:
            try:
                with path.open("rb") as stream:
                    index = index_of(stream, chunk, channel)
                    messages = messages_in(content_of(stream, chunk), index)
            except ValueError as error:
                raise RecordingError(f"{path}: {error}") from error
            begin = len(ENCAPSULATION)  # the iteration is the first member
            iteration = messages[-1, begin : begin + 8].copy().view(np.int64)[0]
            return int(iteration), int(index[-1, 0])
    return None


def _last_entry(path: Path, found: Scan, channel: int) -> int:
    try:
        with path.open("rb") as stream:
            return last_entry_in(stream, found, channel)
    except ValueError as error:
        raise RecordingError(f"{path}: {error}") from error
