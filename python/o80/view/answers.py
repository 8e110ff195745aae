"""Answers of the server to the requests of a page."""

import math
import threading
import time
from collections.abc import Callable, Hashable, Sequence
from typing import Any

import numpy as np

from o80.base.errors import Error, InvalidArgument, ReadOnly
from o80.frontend.frontend import Frontend
from o80.frontend.stopping import halt as halt_backend
from o80.rows.history import History
from o80.view.curves import Panels
from o80.view.scene import Scene
from o80.view.source import NothingToShow, Source
from o80.view.source_list import SourceList

LONGEST_WINDOW = 60.0  # [s]
LONGEST_REASON = 80  # of a halt
MAX_MARKS = 50  # in a chart


class Answers:
    """Answers requests from several threads. Keeps nothing about pages."""

    def __init__(self, sources: SourceList, *, control: bool) -> None:
        self._sources = sources
        self._control = control
        self._shown: dict[str, _Shown] = {}
        self._lock = threading.Lock()

    def look(self, query: dict[str, Any]) -> dict[str, Any]:
        """The list of segments, and what is asked about one of them at one time."""
        sources = self._sources.now()
        answer: dict[str, Any] = {
            "control": self._control,
            "list": [source.state() for source in sources],
            "waiting": self._sources.waiting,
        }
        chosen = _chosen(sources, query.get("source"))
        if chosen is not None:
            answer["source"] = chosen.label
            try:
                answer |= self._row(chosen, query)
            except NothingToShow as error:
                answer["problem"] = str(error)
        return answer

    def _row(self, source: Source, query: dict[str, Any]) -> dict[str, Any]:
        shown = self._shown_of(source)
        first, last = source.extent()
        at = _time_query(source, query)
        if at is None and not source.live and query.get("key") != source.key:
            at = first  # a page begins at the begin of a recording
        row = source.row(at)
        answer: dict[str, Any] = {
            "key": source.key,
            "live": source.live,
            "first": source.seconds(first),
            "last": source.seconds(last),
            "at": source.seconds(row.time),
            "overwritten": source.live and at is not None and at < row.time,
            "iteration": row.iteration,
            "halted": bool(row.halted),
            "overruns": row.overruns,
        }
        if query.get("key") != source.key:
            answer["new"] = shown.introduction(source)
        if shown.scene is not None:
            answer |= shown.scene.poses(_bytes_of(row), row.active)
        panels = query.get("panels")
        panels = shown.panels.first if not isinstance(panels, list) else [str(p) for p in panels]
        answer["values"] = shown.panels.values(row, panels)
        if query.get("curves"):
            answer["curves"] = shown.curves(source, panels, _window(query), at)
        return answer

    def _shown_of(self, source: Source) -> "_Shown":
        schema = source.schema  # NothingToShow, if there is no row
        with self._lock:
            shown = self._shown.get(source.label)
            if shown is None or shown.key != source.key:
                shown = self._shown[source.label] = _Shown(source, schema)
            return shown

    def halt(self, query: dict[str, Any]) -> dict[str, Any]:
        """Halts a live segment."""
        source = self._live(query)
        reason = str(query.get("reason", ""))[:LONGEST_REASON] or "from o80 view"
        return {"halt": halt_backend(source.name, reason)}

    def resume(self, query: dict[str, Any]) -> dict[str, Any]:
        """Clears a halt; only with --control."""
        source = self._live(query)
        if not self._control:
            raise ReadOnly(
                f"this view does not control: start it with --control, or use "
                f"`o80 resume {source.name}`"
            )
        with Frontend(source.name, 1.0) as frontend:
            frontend.resume(int(query["number"]), timeout=5.0)
        return {}

    def _live(self, query: dict[str, Any]) -> Source:
        """The view halts and resumes nothing that it does not show."""
        for source in self._sources.now():
            if source.live and source.name == query.get("segment"):
                return source
        raise InvalidArgument(f"this view does not show a segment {query.get('segment')!r}")


class _Shown:
    """Results that are worked out once for a run of a robot."""

    def __init__(self, source: Source, schema: dict[str, Any]) -> None:
        self.key = source.key
        self.panels = Panels(schema)
        self.scene: Scene | None = None
        self.no_scene = "The driver of this robot names no model, so there is no 3D view."
        self._kept = AnswerCache()
        if "model" in schema:
            try:
                self.scene = Scene(schema, source.model, trusted=source.trusted)
            except Error as error:
                self.no_scene = str(error)

    def introduction(self, source: Source) -> dict[str, Any]:
        """Data that a page needs once."""
        schema = source.schema
        return {
            "robot": schema["robot"],
            "clock": schema["clock"],
            "panels": self.panels.names,
            "units": self.panels.units,
            "first_panels": self.panels.first,
            "scene": None if self.scene is None else self.scene.geometry,
            "no_scene": "" if self.scene is not None else self.no_scene,
        }

    def curves(
        self, source: Source, panels: list[str], window: float, at: int | None
    ) -> dict[str, Any]:
        """Curves of the last seconds, or around a time; shared by pages that ask the same."""

        def read() -> dict[str, Any]:
            first, last = source.extent()
            length = round(window * 1e9)
            end = last if at is None else max(first, min(at + length // 2, last))
            begin = max(first, end - length)  # a run that has just begun fills its chart
            rows = source.rows(begin, end)
            return {
                "begin": source.seconds(begin),
                "end": source.seconds(end),
                "panels": self.panels.curves(rows, panels, begin),
                "marks": _marks_in(rows, source.marks(), begin),
            }

        if at is not None:
            return read()
        found: dict[str, Any] = self._kept.get((source.key, tuple(panels), window), read)
        return found


def _marks_in(rows: History, marks: Sequence[tuple[str, int]], begin: int) -> list[Any]:
    """Seconds from `begin` [ns] and text of the last marks among these rows."""
    iterations = rows.iteration
    return [
        [(int(rows.time[np.searchsorted(iterations, iteration)]) - begin) * 1e-9, text]
        for text, iteration in marks
        if len(rows) and iterations[0] <= iteration <= iterations[-1]
    ][-MAX_MARKS:]


def _bytes_of(row: Any) -> bytes:
    return bytes(memoryview(row))


def _chosen(sources: Sequence[Source], label: Any) -> Source | None:
    for source in sources:
        if source.label == label:
            return source
    for source in sources:
        if source.key and _has_model(source):
            return source
    return sources[0] if sources else None


def _has_model(source: Source) -> bool:
    try:
        return "model" in source.schema
    except Error:
        return False


def _time_query(source: Source, query: dict[str, Any]) -> int | None:
    at = query.get("at")
    if at is None:
        return None
    seconds = float(at)
    if not math.isfinite(seconds) or abs(seconds) > 1e9:
        raise ValueError(f"at must be a time in seconds, got {at}")
    return source.nanoseconds(seconds)


def _window(query: dict[str, Any]) -> float:
    window = float(query.get("window", 5.0))
    if not 0.0 < window <= LONGEST_WINDOW:
        raise ValueError(f"window must be positive and at most {LONGEST_WINDOW:g} s, got {window}")
    return window


SHARED_FOR = 0.08  # [s], less than the time between two requests of a page
LOAD = 10.0  # an answer that took long is kept this many times as long
MOST = 64


class AnswerCache:
    """Answers by what was asked. Many pages, long rows and long windows cost at most a tenth of a
    processor, because what took long is kept longer."""

    def __init__(self) -> None:
        self._answers: dict[Hashable, tuple[float, Any]] = {}
        self._lock = threading.Lock()

    def get(self, query: Hashable, work: Callable[[], Any]) -> Any:
        """The answer of `work`, or the one that another page has just got."""
        with self._lock:
            begin = time.monotonic()
            until, answer = self._answers.get(query, (0.0, None))
            if begin < until:
                return answer
            answer = work()
            end = time.monotonic()
            if len(self._answers) >= MOST:
                self._answers = {key: kept for key, kept in self._answers.items() if kept[0] > end}
            self._answers[query] = end + max(SHARED_FOR, LOAD * (end - begin)), answer
            return answer
