"""Records segments into one file."""

import fnmatch
import os
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from o80.errors import Error, InvalidArgument, RecordingError
from o80.recording.blocks import messages_in
from o80.recording.epoch import EpochNote
from o80.recording.file_writer import FileWriter
from o80.recording.message_plan import ENCAPSULATION
from o80.recording.scan import NotARecordingError, content_of, index_of
from o80.recording.source import Source, Written
from o80.segment_list import segments
from o80.unwritable import reason

BETWEEN_SEARCHES = 0.5  # for segments that match a pattern [s]


class Recorder:
    """Reads segments and writes their rows; `poll` does a part of the work. One thread."""

    between_chunks = 0.1
    """Longest time that `poll` should not be called [s]: what a killed recorder has not written."""

    def __init__(
        self,
        path: str | os.PathLike[str],
        names: Sequence[str],
        *,
        proceed: bool = False,
        whole: bool = False,
        compression: str = "zstd",
    ) -> None:
        """names: of segments, or patterns such as "arm*". proceed: continue an existing file.

        path: ends in .mcap. Raises RecordingError, InvalidArgument: then no new file is left.
        """
        if not names:
            raise InvalidArgument("give the name of at least one segment to record")
        path = Path(path)
        if path.suffix != ".mcap":
            raise RecordingError(
                f"the name of a recording ends in .mcap, got '{path}': o80 plot, export and diff "
                f"know a recording by it"
            )
        self._patterns = [name for name in names if any(sign in name for sign in "*?[")]
        new = not path.exists()
        self.file = opened(path, proceed=proceed, compression=compression)
        self.sources: dict[str, Source] = {}
        self._search_at = 0.0
        try:
            self._written = _written_in(self.file) if proceed else {}
            with self.writing():
                for name in names:
                    if name not in self._patterns:
                        self._add(name, whole)
                self._search(whole)
        except BaseException:
            self._close_sources()
            self.file.close()
            if new:
                path.unlink(missing_ok=True)
            raise

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
        """Writes a chunk of the rows published since the last call; returns how many rows."""
        with self.writing():
            if self._patterns and time.monotonic() >= self._search_at:
                self._search(whole=True)
            blocks = [block for source in self.sources.values() if (block := source.poll())]
            if blocks:
                self.file.add_chunk(blocks)
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

    def catch_up(self) -> None:
        """Polls until every row that was published before the call is written."""
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

    def _add(self, name: str, whole: bool) -> None:
        self.sources[name] = Source(name, self.file, self._written.get(name, {}), whole=whole)

    def _search(self, whole: bool) -> None:
        """Adds segments that match a pattern and are not recorded yet."""
        self._search_at = time.monotonic() + BETWEEN_SEARCHES
        if not self._patterns:
            return
        for segment in segments():
            matches = any(fnmatch.fnmatchcase(segment.name, each) for each in self._patterns)
            if matches and segment.readable and segment.name not in self.sources:
                self._add(segment.name, whole)


def opened(path: Path, *, proceed: bool, compression: str = "zstd") -> FileWriter:
    """A new file; or, to `proceed`, the one that is there. Raises RecordingError."""
    try:
        if proceed and path.exists():
            return FileWriter.continued(path, compression=compression)
        return FileWriter(path, compression=compression)
    except FileExistsError:
        raise RecordingError(
            f"{path} is a folder: give the name of a file"
            if path.is_dir()
            else f"{path} exists. Choose another name, or remove it; "
            f"o80 record --continue appends to it"
        ) from None
    except NotARecordingError as error:
        raise RecordingError(f"{error}: choose another name, or remove it") from None
    except OSError as error:
        raise RecordingError(f"{path} cannot be written: {reason(path, error)}") from error


def _written_in(file: FileWriter) -> dict[str, dict[int, Written]]:
    """What the file holds, by segment and epoch."""
    result: dict[str, dict[int, Written]] = {}
    with file.path.open("rb") as stream:
        for channel in file.found.channels.values():
            note = EpochNote.of(channel.metadata)
            if note is None:
                continue
            last, log_time = -1, 0
            for chunk in reversed(file.found.chunks):
                if channel.id not in chunk.message_index_offsets:
                    continue
                index = index_of(stream, chunk, channel.id)
                messages = messages_in(content_of(stream, chunk), index)
                begin = len(ENCAPSULATION)  # the iteration is the first member
                last = int(messages[-1, begin : begin + 8].copy().view(np.int64)[0])
                log_time = int(index[-1, 0])
                break
            epochs = result.setdefault(note.segment, {})
            epochs[note.epoch] = Written(note, channel.id, last, log_time)
    return result
