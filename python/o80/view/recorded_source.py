"""One epoch of a recording as the source of a page."""

import threading
from bisect import bisect
from collections import Counter
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from o80._core import Observation
from o80.base.errors import Error
from o80.recording.marks import Mark
from o80.recording.recorded_epoch import RecordedEpoch
from o80.rows.history import History
from o80.rows.plans import ChunkEntries, Planned, planned_by_chunks
from o80.view.source import NothingToShow, Source

AHEAD = 3_000_000_000  # time before and after a request for which rows are read [ns]
MOST_ROWS_OF_PLANS = 100_000
SAME_CLOCK = 500_000_000  # offsets to the wall clock that differ by less are of one clock [ns]

Moment = tuple[str, int]  # name of a mark, and how many of this name came before


class RecordedSource(Source):
    """Reads the rows around the shown time, and keeps them for the next request."""

    live = False

    def __init__(
        self,
        name: str,
        number: int,
        epoch: RecordedEpoch,
        marks: Sequence[Mark],
        *,
        model_files: bool = False,
    ) -> None:
        """marks: of this run."""
        self.trusted = model_files
        self.name = name
        self.label = f"{name}, run {number + 1}" if number else name
        self.key = f"recorded {name} {number} {epoch.epoch}"
        self._epoch = epoch
        self._marks = [(mark.name, mark.rows[name]) for mark in marks]
        counts: Counter[str] = Counter()
        self._moments: dict[Moment, tuple[int, int]] = {}  # iteration and wall clock [ns]
        for mark in marks:
            self._moments[mark.name, counts[mark.name]] = mark.rows[name], mark.time
            counts[mark.name] += 1
        self._times: dict[Moment, int] = {}
        self._chunks = epoch.chunk_times
        self._lock = threading.Lock()
        self._kept: tuple[int, int, History] | None = None
        self._decisions: tuple[int, ChunkEntries] | None = None  # first iteration, entries from it
        self._problem = ""
        self._extent: tuple[int, int] | None = None
        try:
            self._extent = self._read_extent()
            self.zero = self._extent[0]
        except Error as error:
            self._problem = str(error)

    def _read_extent(self) -> tuple[int, int]:
        first, last = self._first_rows_in(self._chunks), self._first_rows_in(self._chunks[::-1])
        if first is None or last is None:
            raise NothingToShow(f"the recording has no row of '{self.label}'")
        return int(first.time[0]), int(last.time[-1])

    def _first_rows_in(self, stretches: Iterable[tuple[int, int]]) -> History | None:
        """Returns the rows of the first stretch [ns] that has any; None: none has."""
        read = (self._epoch.history(from_time=begin, to_time=end) for begin, end in stretches)
        return next((rows for rows in read if len(rows)), None)

    @property
    def schema(self) -> dict[str, Any]:
        return self._epoch.schema

    @property
    def model(self) -> str:
        return self._epoch.model

    def refresh(self) -> None:
        """Does nothing: a recording does not change."""

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
        """Returns the newest row before a gap."""
        before = ((begin, min(end, time)) for begin, end in self._chunks[::-1] if begin <= time)
        found = self._first_rows_in(before)
        if found is None:
            raise NothingToShow(f"the recording has no row of '{self.label}' there")
        return found[-1]

    def time_with(self, other: Source, row: Observation) -> int | None:
        if not isinstance(other, RecordedSource) or not self._epoch.overlaps(other._epoch):
            return None
        clocks = self.schema["clock"], other.schema["clock"]
        shift = other._epoch.wall_offset - self._epoch.wall_offset
        if clocks == ("monotonic", "monotonic"):
            return row.time if abs(shift) < SAME_CLOCK else row.time + shift
        # simulated time passes only in bursts: marks of both relate the times
        both = [(other._moments[each][0], each) for each in self._moments if each in other._moments]
        both.sort()
        past = bisect(both, row.iteration, key=lambda each: each[0])
        if past:
            mark = both[past - 1][1]
            found = self._time_of(mark) + row.time - other._time_of(mark)
        else:
            found = row.time if clocks == ("simulated", "simulated") else row.time + shift
        return min(found, self._time_of(both[past][1])) if past < len(both) else found

    def _time_of(self, moment: Moment) -> int:
        """Returns the time [ns] of the row of a mark."""
        iteration, wall = self._moments[moment]
        if self.schema["clock"] == "simulated":
            return iteration * int(self.schema["period"])
        if moment not in self._times:
            at = wall - self._epoch.wall_offset
            rows = self._epoch.history(from_time=at - AHEAD, to_time=at + AHEAD)
            place = int(np.searchsorted(rows.iteration, iteration))
            self._times[moment] = int(rows.time[place]) if place < len(rows) else at
        return self._times[moment]

    def marks(self) -> Sequence[tuple[str, int]]:
        return self._marks

    def rows(self, begin: int, end: int) -> History:
        return self._around(begin, end).select(from_time=begin, to_time=end)

    def plans(self, rows: History) -> dict[str, list[Planned]]:
        """Returns plans of chunks; none far before the end of a long run: its journal is slow."""
        if not len(rows) or not self._epoch.has_journal:
            return {}
        first = int(rows.iteration[0])
        if first < self._epoch.rows - MOST_ROWS_OF_PLANS:
            return {}
        with self._lock:
            if self._decisions is None or first < self._decisions[0]:
                found = ChunkEntries()
                found.add(self._epoch.journal_since_row(first))
                self._decisions = first, found
            known = self._decisions[1]
        return planned_by_chunks(known.entries, rows)

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
