"""The sources of a page: segments by name or pattern, and the runs in recordings."""

import fnmatch
import threading
import time
from collections.abc import Sequence
from pathlib import Path

import o80._core as _core
from o80.base.errors import RecordingError
from o80.frontend.segments import segments as all_segments
from o80.view.live_source import LiveSource
from o80.view.source import Source

BETWEEN_LOOKS = 0.25  # interval of searches for new segments and restarts [s]


class SourceList:
    """Finds segments, also those that start later. May be used from several threads."""

    def __init__(self, names: Sequence[str], *, model_files: bool = False) -> None:
        """names: segments, patterns such as "arm*", recordings (.mcap files, or folders of
            them); none: all segments.
        model_files: read the files that models of recordings and of other users' robots name.

        Raises RecordingError if a recording cannot be read.
        """
        self._model_files = model_files
        self._recorded: list[Source] = []
        self._live: dict[str, LiveSource] = {}
        self._patterns: list[str] = []
        distinct = dict.fromkeys(names)
        for name in distinct:
            if name.endswith(".mcap") or Path(name).is_dir():
                runs = _runs_of(name, model_files)
                for run in runs if len(distinct) > 1 else []:
                    run.label += f" of {name}"  # others may hold a segment of the same name
                self._recorded += runs
            elif any(character in name for character in "*?["):
                self._patterns.append(name)
            else:
                self._live[name] = LiveSource(name, model_files=model_files)
        if not names:
            self._patterns.append("*")
        self._lock = threading.Lock()
        self._look_at = 0.0

    @property
    def waiting(self) -> str:
        """Text for a page while there is nothing to show."""
        if self._patterns == ["*"]:
            return (
                _core.directory_problem()
                or "No robot runs. Start one, for example with: o80 run two_joints"
            )
        return f"No segment matches {', '.join(self._patterns)} yet."

    def now(self) -> list[Source]:
        """Returns all sources; live sources are attached to the current backend."""
        with self._lock:
            if time.monotonic() >= self._look_at:
                self._look()
                self._look_at = time.monotonic() + BETWEEN_LOOKS
            return [*self._live.values(), *self._recorded]

    def _look(self) -> None:
        if self._patterns:
            for entry in all_segments():
                if entry.name not in self._live and any(
                    fnmatch.fnmatchcase(entry.name, pattern) for pattern in self._patterns
                ):
                    self._live[entry.name] = LiveSource(entry.name, model_files=self._model_files)
        for source in self._live.values():
            source.refresh()


def _runs_of(path: str, model_files: bool) -> list[Source]:
    from o80.recording.reader import RecordingFile
    from o80.view.recorded_source import RecordedSource

    recording = RecordingFile(path)
    found: list[Source] = [
        RecordedSource(name, number, epoch, marks, model_files=model_files)
        for name, segment in recording.segments.items()
        for number, (epoch, marks) in enumerate(
            zip(segment.epochs, recording.marks_by_run(name), strict=True)
        )
    ]
    if not found:
        raise RecordingError(f"{path} has no segment: no robot ran meanwhile")
    return found
