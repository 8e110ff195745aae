"""One epoch of a recording as the source of a page."""

import threading
from collections.abc import Sequence
from typing import Any

import numpy as np

from o80._core import Observation
from o80.base.errors import Error
from o80.recording.recorded_epoch import RecordedEpoch
from o80.rows.history import History
from o80.view.source import NothingToShow, Source

AHEAD = 3_000_000_000  # [ns]: rows before and after the ones that are asked for


class RecordedSource(Source):
    """Reads the rows around the time that is shown; keeps them for the next request."""

    live = False

    def __init__(
        self,
        name: str,
        number: int,
        epoch: RecordedEpoch,
        marks: Sequence[tuple[str, int]] = (),
        *,
        model_files: bool = False,
    ) -> None:
        self.trusted = model_files
        self.name = name
        self.label = f"{name}, run {number + 1}" if number else name
        self.key = f"recorded {name} {number} {epoch.epoch}"
        self._epoch = epoch
        self._marks = marks
        self._chunks = epoch.chunk_times
        self._lock = threading.Lock()
        self._kept: tuple[int, int, History] | None = None
        self._problem = ""
        self._extent: tuple[int, int] | None = None
        try:
            self._extent = self._read_extent()
            self.zero = self._extent[0]
        except Error as error:
            self._problem = str(error)

    def _read_extent(self) -> tuple[int, int]:
        first = last = None
        for begin, end in self._chunks:
            first = self._epoch.history(from_time=begin, to_time=end)
            if len(first):
                break
        for begin, end in reversed(self._chunks):
            last = self._epoch.history(from_time=begin, to_time=end)
            if len(last):
                break
        if first is None or last is None or not len(first):
            raise NothingToShow(f"the recording has no row of '{self.label}'")
        return int(first.time[0]), int(last.time[-1])

    @property
    def schema(self) -> dict[str, Any]:
        return self._epoch.schema

    @property
    def model(self) -> str:
        return self._epoch.model

    def refresh(self) -> None:
        """A recording does not change."""

    def extent(self) -> tuple[int, int]:
        if self._extent is None:
            raise NothingToShow(self._problem)
        return self._extent

    def row(self, time: int | None) -> Observation:
        first, last = self.extent()
        at = last if time is None else min(max(time, first), last)
        found = self._around(at, at)
        place = int(np.searchsorted(found.time, at, side="right")) - 1
        if place >= 0:
            return found[place]
        return self._before(at)

    def _before(self, time: int) -> Observation:
        """The newest row before a gap."""
        for begin, end in reversed(self._chunks):
            if begin <= time:
                found = self._epoch.history(from_time=begin, to_time=min(end, time))
                if len(found):
                    return found[-1]
        raise NothingToShow(f"the recording has no row of '{self.label}' there")

    def marks(self) -> Sequence[tuple[str, int]]:
        return self._marks

    def rows(self, begin: int, end: int) -> History:
        return self._around(begin, end).select(from_time=begin, to_time=end)

    def _around(self, begin: int, end: int) -> History:
        with self._lock:
            kept = self._kept
            if kept is None or begin < kept[0] or end > kept[1]:
                wide = begin - AHEAD, end + AHEAD
                kept = self._kept = (*wide, self._epoch.history(from_time=wide[0], to_time=wide[1]))
            return kept[2]

    def state(self) -> dict[str, Any]:
        line: dict[str, Any] = {"name": self.label, "live": False, "alive": False, "halt": None}
        line |= {"state": "recording", "problem": self._problem}
        if self._extent is None:
            return line
        missing = self._epoch.missing
        return line | {
            "robot": self.schema["robot"],
            "rate": f"{1e9 / self.schema['period']:g} Hz",
            "rows": self._epoch.rows,
            "problem": f"{missing} rows are missing" if missing else "",
        }
