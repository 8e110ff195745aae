"""Plans of chunks: the rows that are reached, and the places between them (docs/chunks.md)."""

from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import compress
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

import o80._core as _core
from o80.base.words import Status
from o80.rows.actuators import Number, actuators_of
from o80.rows.columns import Column, columns_of
from o80.rows.history import History, values_of
from o80.rows.journal import ENDS, JournalCommand, JournalEntry

MOST_AHEAD = 20_000  # of the newest row [iterations]

#: places, slopes [1/iteration] and curvatures, of (actuators,) or (iterations, actuators)
Moment = tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]


@dataclass(frozen=True)
class ChunkRows:
    """Rows of a chunk, as they were sent."""

    anchor: int
    due: NDArray[np.int64]  #: iterations after the anchor
    ease: int  #: iterations of the take-over; 0: those that the loop chooses
    first: int
    rows: NDArray[np.float64]  #: (rows, actuators)


@dataclass(frozen=True)
class Decision:
    """The outcome of a chunk that was taken."""

    shift: int
    begins: int
    late: int
    stood: bool


def decide(sent: ChunkRows, taken: int, shift: int, stood: bool) -> Decision:
    """As the loop decides (src/control/receiving/chunk_rows.cpp), from what its status tells."""
    anchor = sent.anchor + shift
    first = 0 if stood else sent.first
    begins = max(taken, anchor + (int(sent.due[first - 1]) if first else 0) + 1)
    return Decision(shift, begins, int(np.searchsorted(sent.due, taken - anchor)), stood)


class NumberLimits(NamedTuple):
    """Limits of one number, as the loop has them."""

    low: float
    high: float
    rates: tuple[float, float, float]  #: of speed, acceleration and jerk, per iteration


def limits_of(number: Number, kind: Any, schema: dict[str, Any]) -> NumberLimits:
    """The limits of a number of an actuator's state, which is of this type."""
    limits = number.limits
    period = schema["period"] / 1e9
    low, high = _range_of(np.dtype(kind))
    rates = (
        limits.speed * period,
        limits.acceleration * period * period,
        limits.jerk * period * period * period,
    )
    return NumberLimits(max(limits.minimum, low), min(limits.maximum, high), rates)


def _range_of(kind: np.dtype[Any]) -> tuple[float, float]:
    if kind.kind not in "fiu":
        return 0.0, 1.0
    numbers = np.finfo(kind) if kind.kind == "f" else np.iinfo(kind)
    return float(numbers.min), float(numbers.max)


class ChunkWay:
    """The way of a chunk from its begin to its last row.

    limits: of each number. switches: which of them are not interpolated: rows are held.
    """

    def __init__(
        self,
        sent: ChunkRows,
        decision: Decision,
        profile: str,
        limits: Sequence[NumberLimits],
        switches: Sequence[bool] = (),
    ) -> None:
        self.begins = decision.begins
        self.rows = sent.rows
        self._limits = limits
        self._sent = sent
        self._switches = switches or [False] * len(limits)
        self._profile = profile
        self._begins = self.begins - sent.anchor - decision.shift  # iterations after the anchor
        # the last iteration of the way to each row, counted from the begin
        self._ends = sent.due - self._begins + 1
        last = int(self._ends[-1])
        if sent.ease and self._first_row(None) == len(sent.rows) - 1:
            last = max(last, sent.ease)
        self._ends[-1] = last
        self.last = self.begins + last - 1

    def _first_row(self, start: Moment | None) -> int:
        """The first row that is reached: by a given `ease`, or from `start`."""
        # by those that are interpolated
        starts = [] if start is None else np.array(start, np.float64).T.tolist()
        moves = [not each for each in self._switches]
        starts = [*compress(starts, moves)]
        rows = [*compress(self.rows.T.tolist(), moves)]
        rates = [each.rates for each in compress(self._limits, moves)]
        due = self._sent.due.tolist()
        row: int = _core.first_row(due, self._begins, self._sent.ease, starts, rows, rates)
        return row

    def places(self, start: Moment, most: int | None = None, row: int | None = None) -> Moment:
        """Places and derivatives (iterations, actuators) from its begin to its last row, at most
        so many.

        start: of the iteration before. row: the first that is reached, if that is known.
        """
        row = self._first_row(start) if row is None else row
        held = min(int(np.searchsorted(self._ends, 1)), len(self.rows) - 1)
        last = int(self._ends[-1])
        shape = len(self.rows.T), last if most is None else min(most, last)
        plans = []
        for moment, rows, limit, switches in zip(
            np.array(start, np.float64).T.tolist(),
            self.rows.T.tolist(),
            self._limits,
            self._switches,
            strict=True,
        ):
            first, profile = (held, "hold") if switches else (row, self._profile)
            ends = np.maximum(self._ends[first:], 1).tolist()
            plans.append(
                _core.plan_of_rows(
                    moment, rows[first:], ends, profile, shape[1], limit.low, limit.high
                )
            )
        places, slopes, curvatures = (
            np.frombuffer(b"".join(each[i] for each in plans)).reshape(shape).T for i in range(3)
        )
        return places, slopes, curvatures


class Planned(NamedTuple):
    """The plan of a chunk for one number, whatever came of it."""

    begins: int  #: the first iteration
    places: NDArray[np.float64]  #: (iterations,)
    derivatives: NDArray[np.float64]  #: (2, iterations): slopes [1/iteration] and curvatures


class ChunkEntries:
    """Entries of a journal that say what became of chunks; at most the newest `most`."""

    def __init__(self, most: int | None = None) -> None:
        self.entries: deque[JournalEntry] = deque(maxlen=most)
        self._open: set[tuple[int | None, int | None]] = set()  # lane and id

    def add(self, entries: Iterable[JournalEntry]) -> None:
        for entry in entries:
            chunks = [each.id for each in entry.commands if each.pace == "chunk"]
            if entry.kind == "taken" and chunks:
                self._open.update((entry.lane, each) for each in chunks)
                self.entries.append(entry)
            elif entry.kind == "status" and (entry.lane, entry.id) in self._open:
                self.entries.append(entry)
                if entry.status in ENDS:
                    self._open.discard((entry.lane, entry.id))


def planned_by_chunks(
    entries: Iterable[JournalEntry], history: History
) -> dict[str, list[Planned]]:
    """The plans of the chunks that began in these rows, by number: "elbow", "elbow.position".

    They begin where the plan of the chunk before them was if that was in force, else at the desired
    state, with its differences. Chunks whose begin or the row before it is not there are left out,
    and iterations far ahead of the newest row.
    """
    found: dict[str, list[Planned]] = {}
    iterations = history.iteration
    if not len(iterations):
        return found
    columns = {each.name: each for each in columns_of(history.schema)}
    latest = int(iterations[-1]) + MOST_AHEAD
    number_of = _numbers_by_name(history.schema)
    waiting: dict[tuple[int | None, int | None], tuple[JournalEntry, JournalCommand]] = {}
    numbers: dict[tuple[int | None, int | None], list[str]] = {}
    ends: dict[str, tuple[int, Status | None]] = {}  # of the last chunk of each number
    for entry in entries:
        key = entry.lane, entry.id
        if entry.kind == "taken":
            for command in entry.commands:
                if command.pace == "chunk":
                    waiting[entry.lane, command.id] = entry, command
        elif entry.kind == "status" and entry.status in ENDS:
            ends |= dict.fromkeys(numbers.pop(key, ()), (entry.iteration, entry.status))
        elif entry.kind == "status" and entry.status == Status.ACTIVE and key in waiting:
            taken, command = waiting.pop(key)
            begins = entry.iteration
            place = int(np.searchsorted(iterations, begins - 1))
            if place >= len(iterations) or iterations[place] != begins - 1:
                continue
            shift = _shift(taken, command, history)
            given = [each for each in _numbers(command) if f"desired.{each[0]}" in columns]
            numbers[key] = [number for number, _ in given]
            if not given:
                continue
            starts: list[Moment] = []
            for number, _ in given:
                before = found.setdefault(number, [])[-1:]
                start = _start(before, ends.pop(number, None), begins)
                if start is None:
                    start = _desired(history, columns[f"desired.{number}"], place, command)
                starts.append(start)
            limits = [limits_of(number_of[n], rows.dtype, history.schema) for n, rows in given]
            switches = [rows.dtype.kind == "b" for _, rows in given]
            values = np.stack([rows.astype(np.float64) for _, rows in given], axis=1)
            way = _way(taken, command, values, shift, begins, limits, switches)
            at = tuple(np.concatenate(each) for each in zip(*starts, strict=True))
            plan = way.places(cast("Moment", at), latest - begins)
            for i, (number, _) in enumerate(given):
                places, *derivatives = (each[:, i] for each in plan)
                found[number].append(Planned(begins, places, np.array(derivatives)))
    return found


def _way(
    taken: JournalEntry,
    command: JournalCommand,
    rows: NDArray[np.float64],
    shift: int,
    begins: int,
    limits: list[NumberLimits],
    switches: list[bool],
) -> ChunkWay:
    anchor = command.anchor or 0
    due = np.array(command.due, np.int64) - anchor
    ease = 1 if command.profile == "hold" else command.ease or 0
    sent = ChunkRows(anchor, due, ease, command.first or 0, rows)
    decision = decide(sent, taken.iteration, shift, stood=shift > 0)
    if decision.begins != begins:  # it had a prefix that did not count: the actuators stood
        decision = decide(sent, taken.iteration, shift, stood=True)
    return ChunkWay(sent, decision, command.profile, limits, switches)


def _numbers_by_name(schema: dict[str, Any]) -> dict[str, Number]:
    """The numbers of all actuators: "elbow", "elbow.position"."""
    return {
        ".".join(filter(None, (each.name or str(each.index), number.name))): number
        for each in actuators_of(schema)
        for number in each.numbers
    }


def _indices(history: History, command: JournalCommand) -> list[int]:
    names = [each["name"] or str(i) for i, each in enumerate(history.schema["actuators"])]
    return [names.index(name) for name in command.actuators]


def _shift(taken: JournalEntry, command: JournalCommand, history: History) -> int:
    """By how much its rows are later, because its actuators stood still (docs/chunks.md)."""
    last = taken.iteration - 1
    if command.fixed or command.anchor is None or command.anchor >= last:
        return 0
    moved = history.active[:, _indices(history, command)].any(axis=1)
    acted = history.iteration[moved & (history.iteration <= last)]
    acted_last = int(acted[-1]) if len(acted) else -1
    return last - max(acted_last, command.anchor) if acted_last < last else 0


def _numbers(command: JournalCommand) -> Iterable[tuple[str, NDArray[np.generic]]]:
    """Each number that it gives rows of, with the rows (rows,)."""
    for actuator, target in zip(command.actuators, command.targets, strict=True):
        fields = target if isinstance(target, dict) else {"": target}
        for field, values in fields.items():
            rows = np.atleast_1d(np.asarray(values))
            if rows.ndim == 1 and rows.dtype.kind in "fiub":
                yield f"{actuator}.{field}" if field else actuator, rows


def _start(
    before: list[Planned], end: tuple[int, Status | None] | None, begins: int
) -> Moment | None:
    """Place and slope of the plan before, if that is in force until a chunk begins."""
    if not before or end not in (None, (begins, Status.OVERWRITTEN)):
        return None
    at = begins - before[0].begins - 1
    if not 0 <= at < len(before[0].places):
        return None
    slope, curvature = before[0].derivatives[:, at : at + 1]
    return before[0].places[at : at + 1], slope, curvature


def _desired(history: History, column: Column, place: int, command: JournalCommand) -> Moment:
    """Where the number was in a row, and its differences; 0 if its actuator did not act there."""
    desired = np.asarray(values_of(history, column), np.float64)
    acts = np.any(history.active[:, _indices(history, command)], axis=1)
    speeds = [
        desired[at] - desired[at - 1] if at > 0 and acts[at] else 0.0
        for at in (place, max(0, place - 1))
    ]
    curvature = speeds[0] - speeds[1] if acts[place] else 0.0
    return desired[place : place + 1], np.array([speeds[0]]), np.array([curvature])
