"""Plans of chunks: the rows that are reached, and the places between them (docs/chunks.md)."""

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

import o80._core as _core
from o80.base.words import Status
from o80.rows.columns import Column, columns_of
from o80.rows.history import History, values_of
from o80.rows.journal import ENDS, JournalCommand, JournalEntry

MOST_AHEAD = 20_000  # of the newest row [iterations]

#: places and slopes [1/iteration], of (actuators,) or (iterations, actuators)
Moment = tuple[NDArray[np.float64], NDArray[np.float64]]


@dataclass(frozen=True)
class ChunkRows:
    """Rows of a chunk, as they were sent."""

    anchor: int
    due: NDArray[np.int64]  #: iterations after the anchor
    ease: int
    first: int
    rows: NDArray[np.float64]  #: (rows, actuators)


@dataclass(frozen=True)
class Decision:
    """The outcome of a chunk that was taken."""

    shift: int
    begins: int
    late: int
    row: int  #: the first that is reached
    stood: bool


def decide(sent: ChunkRows, taken: int, shift: int, stood: bool) -> Decision:
    """As the loop decides (src/control/batch/chunk.cpp), from what its status tells."""
    anchor = sent.anchor + shift
    first = 0 if stood else sent.first
    begins = max(taken, anchor + (int(sent.due[first - 1]) if first else 0) + 1)
    late = int(np.searchsorted(sent.due, taken - anchor))
    row = int(np.searchsorted(sent.due, begins + sent.ease - 1 - anchor))
    return Decision(shift, begins, late, min(row, len(sent.due) - 1), stood)


class ChunkWay:
    """The way of a chunk from its begin to its last row.

    switches: its numbers are not interpolated: rows are held.
    """

    def __init__(
        self, sent: ChunkRows, decision: Decision, profile: str, switches: bool = False
    ) -> None:
        self.begins = decision.begins
        ends = sent.due + (sent.anchor + decision.shift - self.begins + 1)
        last = max(int(ends[-1]), sent.ease if decision.row == len(ends) - 1 else 1)
        row = int(np.searchsorted(ends, 1)) if switches else decision.row
        self._profile = "hold" if switches else profile
        self.rows = sent.rows[min(row, len(ends) - 1) :]
        # the last iteration of the way to each row, counted from the begin
        self._ends = ends[-len(self.rows) :]
        self._ends[0] = max(int(self._ends[0]), 1)
        self._ends[-1] = last
        self.last = self.begins + last - 1

    def places(self, start: Moment, most: int | None = None) -> Moment:
        """Places and slopes (iterations, actuators) from its begin to its last row, at most so
        many.
        """
        ends = self._ends.tolist()
        shape = len(self.rows.T), ends[-1] if most is None else min(most, ends[-1])
        plans = [
            _core.plan_of_rows(place, slope, rows, ends, self._profile, shape[1])
            for place, slope, rows in zip(
                *(each.tolist() for each in start), self.rows.T.tolist(), strict=True
            )
        ]
        places, slopes = (
            np.frombuffer(b"".join(each[i] for each in plans)).reshape(shape).T for i in (0, 1)
        )
        return places, slopes


class Planned(NamedTuple):
    """The plan of a chunk for one number, whatever came of it."""

    begins: int  #: the first iteration
    places: NDArray[np.float64]  #: (iterations,)
    slopes: NDArray[np.float64]  #: (iterations,) [1/iteration]


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
    state, with its speed. Chunks whose begin or the row before it is not there are left out, and
    iterations far ahead of the newest row.
    """
    found: dict[str, list[Planned]] = {}
    iterations = history.iteration
    if not len(iterations):
        return found
    columns = {each.name: each for each in columns_of(history.schema)}
    latest = int(iterations[-1]) + MOST_AHEAD
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
            numbers[key] = []
            for number, rows in _numbers(command):
                column = columns.get(f"desired.{number}")
                if column is None:
                    continue
                way = _way(taken, command, rows, shift, begins)
                before = found.setdefault(number, [])
                start = _start(before[-1:], ends.pop(number, None), begins)
                if start is None:
                    start = _desired(history, column, place, command)
                places, slopes = way.places(start, latest - begins)
                before.append(Planned(begins, places[:, 0], slopes[:, 0]))
                numbers[key].append(number)
    return found


def _way(
    taken: JournalEntry, command: JournalCommand, rows: NDArray[Any], shift: int, begins: int
) -> ChunkWay:
    anchor = command.anchor or 0
    due = np.array(command.due, np.int64) - anchor
    values = rows[:, None].astype(np.float64)
    sent = ChunkRows(anchor, due, command.ease or 1, command.first or 0, values)
    decision = decide(sent, taken.iteration, shift, stood=shift > 0)
    if decision.begins != begins:  # it had a prefix that did not count: the actuators stood
        decision = decide(sent, taken.iteration, shift, stood=True)
    return ChunkWay(sent, decision, command.profile, rows.dtype.kind != "f")


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
    return before[0].places[at : at + 1], before[0].slopes[at : at + 1]


def _desired(history: History, column: Column, place: int, command: JournalCommand) -> Moment:
    """Where the number was in a row, and its speed; 0 if its actuator did not act there."""
    desired = np.asarray(values_of(history, column), np.float64)
    acts = place > 0 and history.active[place, _indices(history, command)].any()
    speed = desired[place] - desired[place - 1] if acts else 0.0
    return desired[place : place + 1], np.array([speed])
