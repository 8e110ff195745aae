"""Plans of chunks: the rows that are reached, and the places between them (docs/chunks.md)."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

import o80._core as _core
from o80.base.words import Status
from o80.rows.columns import Column, columns_of
from o80.rows.history import History, values_of
from o80.rows.journal import JournalCommand, JournalEntry

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


def is_of_chunks(entry: JournalEntry) -> bool:
    """Whether planned_by_chunks may look at it."""
    if entry.kind == "taken":
        return any(command.pace == "chunk" for command in entry.commands)
    return entry.kind == "status" and entry.status == Status.ACTIVE


def planned_by_chunks(
    entries: Iterable[JournalEntry], history: History
) -> dict[str, list[Planned]]:
    """The plans of the chunks that began in these rows, by number: "elbow", "elbow.position".

    They begin where the plan of the chunk before them was, else at the desired state, with its
    speed. Chunks whose begin or the row before it is not there are left out.
    """
    found: dict[str, list[Planned]] = {}
    iterations = history.iteration
    if not len(iterations):
        return found
    columns = {each.name: each for each in columns_of(history.schema)}
    waiting: dict[tuple[int | None, int], tuple[JournalEntry, JournalCommand]] = {}
    for entry in entries:
        if entry.kind == "taken":
            for command in entry.commands:
                if command.pace == "chunk":
                    waiting[entry.lane, command.id] = entry, command
        elif entry.kind == "status" and entry.status == Status.ACTIVE and entry.id is not None:
            begun = waiting.pop((entry.lane, entry.id), None)
            place = int(np.searchsorted(iterations, entry.iteration - 1))
            is_there = place < len(iterations) and iterations[place] == entry.iteration - 1
            if begun is None or not is_there:
                continue
            taken, command = begun
            shift = _shift(taken, command, entry.iteration, history)
            for number, rows in _numbers(command):
                column = columns.get(f"desired.{number}")
                if column is None:
                    continue
                due = np.array(command.due, np.int64) - (command.anchor or 0)
                sent = ChunkRows(
                    command.anchor or 0,
                    due,
                    command.ease or 1,
                    command.first or 0,
                    rows[:, None].astype(np.float64),
                )
                decision = decide(sent, taken.iteration, shift, stood=shift > 0)
                way = ChunkWay(sent, decision, command.profile, rows.dtype.kind != "f")
                before = found.setdefault(number, [])
                places, slopes = way.places(_start(before, history, column, place, way.begins))
                before.append(Planned(way.begins, places[:, 0], slopes[:, 0]))
    return found


def _shift(taken: JournalEntry, command: JournalCommand, begins: int, history: History) -> int:
    """By how much its rows are later, because its actuators stood still (docs/chunks.md)."""
    last = taken.iteration - 1
    if command.fixed or command.anchor is None or command.anchor >= last or begins > last + 1:
        return 0
    names = [actuator["name"] for actuator in history.schema["actuators"]]
    moved = history.active[:, [names.index(name) for name in command.actuators]].any(axis=1)
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
    before: list[Planned], history: History, column: Column, place: int, begins: int
) -> Moment:
    """Place and slope in the iteration before a chunk begins."""
    for planned in before[-1:]:
        at = begins - planned.begins - 1
        if 0 <= at < len(planned.places):
            return planned.places[at : at + 1], planned.slopes[at : at + 1]
    desired = np.asarray(values_of(history, column), np.float64)
    speed = desired[place] - desired[place - 1] if place > 0 else 0.0
    return desired[place : place + 1], np.array([speed])
