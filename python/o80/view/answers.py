"""Answers of the server to the requests of a page."""

import math
import threading
import time
from collections.abc import Callable, Hashable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any

import numpy as np

import o80._core as _core
from o80._core import Observation
from o80.base.errors import Error, InvalidArgument, ReadOnly
from o80.frontend.frontend import Frontend
from o80.frontend.stopping import halt as halt_backend
from o80.rows.history import History
from o80.view.curves import Panels
from o80.view.scene import Scene
from o80.view.source import NothingToShow, Source
from o80.view.source_list import SourceList
from o80.view.world import Standing

LONGEST_WINDOW = 60.0  # [s]
LONGEST_REASON = 80  # most characters of the reason of a halt
MAX_MARKS = 50  # newest marks in a chart
MAKERS = 2  # threads that read models
SLACK = 1_000_000_000  # a robot is drawn for this time before its first and after its last row [ns]


class Answers:
    """Answers requests from several threads, without state of pages."""

    def __init__(self, sources: SourceList, *, control: bool) -> None:
        self._sources = sources
        self._control = control
        self._shown: dict[str, tuple[str, Future[Shown]]] = {}  # by label, with the key
        self._makers = ThreadPoolExecutor(MAKERS)
        self._lock = threading.Lock()

    def look(self, query: dict[str, Any]) -> dict[str, Any]:
        """Returns the list of segments, and the requested data of one of them at one time."""
        sources = self._sources.now()
        of_world = sorted(sources, key=lambda source: not source.alive)
        answer: dict[str, Any] = {
            "control": self._control,
            "list": [source.state() for source in sources],
            "waiting": self._sources.waiting,
        }
        chosen = _chosen(of_world, query.get("source"))
        if chosen is not None:
            answer["source"] = chosen.label
            try:
                row, at = self._row_of(chosen, query)
                self._shown_of(chosen, wait=False)  # the models are read at the same time
                others = self._others(chosen, of_world, query, row, now=at is None)
                answer |= self._row(chosen, query, row, at) | {"others": others}
            except NothingToShow as error:
                answer["problem"] = str(error)
        return answer

    def _row_of(self, source: Source, query: dict[str, Any]) -> tuple[Observation, int | None]:
        """Returns the row to show, and the requested time [ns]; None: now."""
        at = _time_query(source, query)
        if at is None and not source.live and query.get("key") != source.key:
            at = source.extent()[0]  # a page begins at the begin of a recording
        return source.row(at), at

    def _others(
        self,
        chosen: Source,
        sources: Sequence[Source],
        query: dict[str, Any],
        of_chosen: Observation,
        *,
        now: bool,
    ) -> dict[str, Any]:
        """Returns by other source whether it shares the world of the chosen one, and the poses of
        its bodies, at the time of the chosen one's row or now.

        The query lists sources that the user has chosen to show or hide (`seen`), and scenes that
        the page has (`known`: keys). A scene that is not ready is made in the background.
        """
        wanted, known = _mapping(query, "seen"), _mapping(query, "known")
        found: dict[str, Any] = {}
        for source, row, shares in others_of(chosen, sources, of_chosen, now=now):
            found[source.label] = {"shares": shares, "key": source.key}
            if not wanted.get(source.label, shares):
                continue
            shown = self._shown_of(source, wait=False)
            if shown is not None and shown.scene is not None:
                found[source.label]["pose"] = shown.scene.poses(row)["pose"]
                if known.get(source.label) != source.key:
                    found[source.label]["scene"] = shown.scene.geometry
        return found

    def _row(
        self, source: Source, query: dict[str, Any], row: Observation, at: int | None
    ) -> dict[str, Any]:
        shown = self._shown_of(source)
        assert shown is not None
        first, last = source.extent()
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
            answer |= shown.scene.poses(row)
        panels = query.get("panels")
        panels = shown.panels.first if not isinstance(panels, list) else [str(p) for p in panels]
        answer["values"] = shown.panels.values(row, panels)
        if query.get("curves"):
            answer["curves"] = shown.curves(source, panels, _window(query), at)
        return answer

    def _shown_of(self, source: Source, *, wait: bool = True) -> "Shown | None":
        """Returns the prepared data of a source; None if they are not ready and `wait` is False."""
        schema = source.schema  # raises NothingToShow if there is no row
        with self._lock:
            key, made = self._shown.get(source.label, ("", None))
            if made is None or key != source.key:
                key, made = source.key, self._makers.submit(Shown, source, schema)
                self._shown[source.label] = key, made
        return made.result() if wait or made.done() else None

    def halt(self, query: dict[str, Any]) -> dict[str, Any]:
        """Halts a live segment."""
        source = self._live(query)
        reason = _core.printable(query.get("reason") or "from o80 view")[:LONGEST_REASON]
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
        """Finds a live source by segment. Raises InvalidArgument if the view does not show it."""
        for source in self._sources.now():
            if source.live and source.name == query.get("segment"):
                return source
        raise InvalidArgument(f"this view does not show a segment {query.get('segment')!r}")


class Shown:
    """Data that are computed once for each run of a robot."""

    def __init__(self, source: Source, schema: dict[str, Any]) -> None:
        self.panels = Panels(schema)
        self.scene: Scene | None = None
        self.no_scene = "The driver of this robot names no model, so it is not drawn."
        self._kept = AnswerCache()
        if source.drawn is not None:
            try:
                self.scene = Scene(schema, source.drawn)
            except Error as error:
                self.no_scene = str(error)

    def introduction(self, source: Source) -> dict[str, Any]:
        """Returns data that a page needs once."""
        schema = source.schema
        return {
            "robot": schema["robot"],
            "clock": schema["clock"],
            "panels": self.panels.names,
            "units": self.panels.units,
            "labels": self.panels.labels,
            "first_panels": self.panels.first,
            "scene": None if self.scene is None else self.scene.geometry,
            "no_scene": "" if self.scene is not None else self.no_scene,
        }

    def curves(
        self, source: Source, panels: list[str], window: float, at: int | None
    ) -> dict[str, Any]:
        """Returns curves of the last seconds, or around a time; equal requests share them."""

        def read() -> dict[str, Any]:
            first, last = source.extent()
            length = round(window * 1e9)
            end = last if at is None else max(first, min(at + length // 2, last))
            begin = max(first, end - length)  # a run that has just begun fills its chart
            rows = source.rows(begin, end)
            drawn = self.panels.curves(rows, panels, begin)
            ahead = self.panels.add_plans(drawn, source.plans(rows), rows, begin)
            return {
                "begin": source.seconds(begin),
                "end": source.seconds(max(end, min(ahead, end + length // 3))),
                "panels": drawn,
                "marks": _marks_in(rows, source.marks(), begin),
            }

        if at is not None:
            return read()
        found: dict[str, Any] = self._kept.get((source.key, tuple(panels), window), read)
        return found


def _marks_in(rows: History, marks: Sequence[tuple[str, int]], begin: int) -> list[Any]:
    """Returns seconds from `begin` [ns] and text of the last marks among these rows."""
    iterations = rows.iteration
    return [
        [(int(rows.time[np.searchsorted(iterations, iteration)]) - begin) * 1e-9, text]
        for text, iteration in marks
        if len(rows) and iterations[0] <= iteration <= iterations[-1]
    ][-MAX_MARKS:]


def _chosen(sources: Sequence[Source], label: Any) -> Source | None:
    return next((each for each in sources if each.label == label), None) or first_of(sources)


def first_of(sources: Sequence[Source]) -> Source | None:
    """Returns the source to show first: with a fixed model, else with any model, else any."""
    models = [source for source in sources if source.drawn is not None]
    standing = [source for source in models if source.drawn and not source.drawn.standing.floats]
    return next(iter([*standing, *models, *sources]), None)


_ANY = Standing(floats=True)


def others_of(
    chosen: Source, sources: Sequence[Source], of_chosen: Observation, *, now: bool
) -> Iterator[tuple[Source, Observation, bool]]:
    """Yields each other source with a model, its row, and whether it stands in the same world.

    now: take its newest row, not the one at the time of `of_chosen`.
    The world is that of the first fixed model. Robots with the same model are copies, and the world
    has one of them: the chosen one, else the first.
    """
    others = [source for source in sources if source is not chosen]
    rows: list[tuple[Source, Observation | None]] = [(chosen, None)]
    rows += [(source, _row_with(source, chosen, of_chosen, now=now)) for source in others]
    models = [(source, row, drawn) for source, row in rows if (drawn := source.drawn) is not None]
    world = next((each.standing for *_, each in models if not each.standing.floats), _ANY)
    copies: set[str] = set()
    for source, row, drawn in models:
        shares = drawn.standing.shares(world) and drawn.mjcf not in copies
        if shares and not drawn.standing.floats and (row is not None or source is chosen):
            copies.add(drawn.mjcf)
        if row is not None:
            yield source, row, shares


def _row_with(
    source: Source, chosen: Source, of_chosen: Observation, *, now: bool
) -> Observation | None:
    """Returns a source's row at the time of another source's row, or now; None: no row."""
    try:
        if now and source.live and chosen.live:
            return source.row(None)
        first, last = source.extent()
        time = source.time_with(chosen, of_chosen)
        within = time is not None and first - SLACK <= time <= last + SLACK
        return source.row(time) if within else None
    except Error:
        return None


def _time_query(source: Source, query: dict[str, Any]) -> int | None:
    at = query.get("at")
    if at is None:
        return None
    seconds = float(at)
    if not math.isfinite(seconds) or abs(seconds) > 1e9:
        raise ValueError(f"at must be a time in seconds, got {at}")
    return source.nanoseconds(seconds)


def _mapping(query: dict[str, Any], name: str) -> dict[str, Any]:
    found = query.get(name) or {}
    if not isinstance(found, dict):
        raise TypeError(f"{name} must be a mapping from segments, got {found!r:.60}")
    return found


def _window(query: dict[str, Any]) -> float:
    window = float(query.get("window", 5.0))
    if not 0.0 < window <= LONGEST_WINDOW:
        raise ValueError(f"window must be positive and at most {LONGEST_WINDOW:g} s, got {window}")
    return window


SHARED_FOR = 0.08  # [s], less than the time between two requests of a page
LOAD = 10.0  # an answer is kept this many times as long as it took
MOST = 64


class AnswerCache:
    """Caches each answer ten times as long as its computation took: so all pages together use at
    most a tenth of a processor."""

    def __init__(self) -> None:
        self._answers: dict[Hashable, tuple[float, Any]] = {}
        self._lock = threading.Lock()

    def get(self, query: Hashable, work: Callable[[], Any]) -> Any:
        """Returns the cached answer to this query, or calls `work` and caches its result."""
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
