"""A segment in shared memory as the source of a page."""

import threading
from collections.abc import Sequence
from typing import Any

import o80._core as _core
from o80._core import Observation
from o80.base.errors import Error, RowOverwritten, TimeoutError
from o80.frontend.backend_texts import age_text, rate_text
from o80.frontend.frontend import Frontend
from o80.frontend.reader import Journal
from o80.frontend.results import Halt
from o80.frontend.segments import is_own
from o80.rows.history import History
from o80.rows.plans import ChunkEntries, Planned, planned_by_chunks
from o80.view.source import NothingToShow, Source

GUARD_ROWS = 16  # the oldest rows may be overwritten while they are read
JOURNAL_BYTES = 1 << 20  # bytes of the journal read at once
MAX_MARKS = 1000  # newest marks to keep
MAX_DECISIONS = 500  # newest decisions about chunks to keep


class LiveSource(Source):
    """Follows a segment by name across restarts of its backend. Read-only."""

    live = True

    def __init__(self, name: str, *, model_files: bool = False) -> None:
        self._model_files = model_files
        self.name = self.label = name
        self._frontend: Frontend | None = None
        self._journal: _core.RawJournal | None = None
        self._marks: list[tuple[str, int]] = []
        self._decisions: Journal | None = None
        self._of_chunks = ChunkEntries(MAX_DECISIONS)
        self._lock = threading.Lock()
        self._problem = ""
        self._state = "waiting"  # without a frontend

    def refresh(self) -> None:
        with self._lock:
            known = self._frontend
            if known is not None and known.alive:
                return
            try:
                found = Frontend(self.name, 0.0, read_only=True, dead=True)
            except Error as error:
                self._problem = str(error)
                self._state = "waiting" if isinstance(error, TimeoutError) else "unknown"
                return
            if found.published < 0 or (known is not None and known.epoch == found.epoch):
                self._problem = "" if known is not None else "there is no row yet"
                found.close()
                return
            self.trusted = self._model_files or is_own(found)
            self._frontend, self._problem = found, ""
            self._journal, self._marks = _core.RawJournal(found, 0), []
            self._decisions = Journal(found, new=True)
            self._of_chunks = ChunkEntries(MAX_DECISIONS)
            self.key = f"{self.name} {found.epoch}"
            self.zero = self.extent_of(found)[0]
            # the former frontend is not closed: another thread may be reading with it

    @property
    def alive(self) -> bool:
        frontend = self._frontend
        return frontend is not None and frontend.alive

    @property
    def _attached(self) -> Frontend:
        if self._frontend is None:
            raise NothingToShow(self._problem or f"waiting for segment '{self.name}'")
        return self._frontend

    @property
    def schema(self) -> dict[str, Any]:
        return self._attached.schema

    @property
    def model(self) -> str:
        return self._attached._layout.model

    def extent(self) -> tuple[int, int]:
        return self.extent_of(self._attached)

    @staticmethod
    def extent_of(frontend: Frontend) -> tuple[int, int]:
        return oldest_row(frontend).time, frontend.latest().time

    def row(self, time: int | None) -> Observation:
        frontend = self._attached
        if time is None:
            return frontend.latest()
        try:
            return frontend.at_time(time)
        except RowOverwritten:
            return oldest_row(frontend)

    def rows(self, begin: int, end: int) -> History:
        return self._attached.history(from_time=begin, to_time=end)

    def time_with(self, other: Source, row: Observation) -> int | None:
        if not other.live:
            return None
        if self.schema["clock"] == other.schema["clock"] == "monotonic":
            return row.time
        # of simulated times only the present ones are known: both are assumed to run alike
        return self.extent()[1] - (other.extent()[1] - row.time)

    def marks(self) -> Sequence[tuple[str, int]]:
        with self._lock:
            journal, more = self._journal, True
            while journal is not None and journal.exists and more:
                *_, more, found, _ = journal.read(JOURNAL_BYTES)
                self._marks += found
            del self._marks[:-MAX_MARKS]
            return list(self._marks)

    def plans(self, rows: History) -> dict[str, list[Planned]]:
        """Returns the plans of chunks that were sent since the view attached to this run."""
        with self._lock:
            if self._decisions is not None:
                self._of_chunks.add(self._decisions.read())
            known = list(self._of_chunks.entries)
        return planned_by_chunks(known, rows)

    def state(self) -> dict[str, Any]:
        line: dict[str, Any] = {
            "name": self.name,
            "live": True,
            "state": self._state,
            "problem": self._problem,
        }
        frontend = self._frontend
        if frontend is None:
            return line
        loop = _core.loop_state(frontend)
        alive = self.alive
        halt = frontend.halted if alive else None
        rate = "bursting" if loop.bursting else rate_text(loop.rate, loop.frequency)
        return line | {
            "robot": frontend.robot,
            "state": loop.word,
            "alive": alive,
            "rate": rate if alive else "",
            "overruns": loop.overruns,
            "missed": loop.skipped,
            "age": "" if loop.row_age is None else age_text(loop.row_age),
            "row_age": loop.row_age,
            "halt": None if halt is None else _halt(halt),
            "problem": loop.trouble if alive else "",
        }


def oldest_row(frontend: Frontend) -> Observation:
    """Returns the oldest row that can be read; the newest one if all are being overwritten."""
    oldest = frontend.oldest
    rows = frontend.history(since=oldest, until=oldest + GUARD_ROWS)
    return rows[0] if len(rows) else frontend.latest()


def _halt(halt: Halt) -> dict[str, Any]:
    reason = f": {halt.text}" if halt.text else ""
    by = f" by {halt.who}" if halt.who else ""
    return {"number": halt.number, "text": f"halted{by} (halt {halt.number}, {halt.cause}){reason}"}
