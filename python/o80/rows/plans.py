"""Plans of chunks: the rows that are reached, and the places between them (docs/chunks.md)."""

from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import compress
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

import o80._core as _core
from o80.rows.actuators import Number, actuators_of, blending
from o80.rows.columns import columns_of
from o80.rows.history import History
from o80.rows.journal import JournalCommand, JournalEntry

MOST_AHEAD = 20_000  # iterations beyond the newest row

#: places, slopes [1/iteration] and curvatures, of (actuators,) or (iterations, actuators)
Moment = tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]


@dataclass(frozen=True)
class ChunkRows:
    """Rows of a chunk, in the form in which they were sent."""

    anchor: int
    due: NDArray[np.int64]  #: iterations after the anchor
    ease: int  #: iterations of the take-over; 0: chosen by the loop
    first: int
    rows: NDArray[np.float64]  #: (rows, actuators)


@dataclass(frozen=True)
class Decision:
    """The result of a chunk that was taken."""

    shift: int
    begins: int
    late: int = 0


def decide(sent: ChunkRows, taken: int, shift: int, stood: bool) -> Decision:
    """Repeats the loop's decision (src/control/receiving/chunk_rows.cpp) from a chunk's status."""
    anchor = sent.anchor + shift
    first = 0 if stood else sent.first
    begins = max(taken, anchor + (int(sent.due[first - 1]) if first else 0) + 1)
    return Decision(shift, begins, int(np.searchsorted(sent.due, taken - anchor)))


class NumberLimits(NamedTuple):
    """Limits of one number, in the form of the loop."""

    low: float
    high: float
    rates: tuple[float, float, float]  #: speed, acceleration and jerk, per iteration


def limits_of(number: Number, kind: Any, schema: dict[str, Any]) -> NumberLimits:
    """Converts the limits of a number whose type is `kind`."""
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

    limits: of each number. switches: numbers that are not interpolated: they hold each row.
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
        # last iteration of the way to each row, counted from the begin
        self._ends = sent.due - self._begins + 1
        last = int(self._ends[-1])
        if sent.ease and self._first_row(None) == len(sent.rows) - 1:
            last = max(last, sent.ease)
        self._ends[-1] = last
        self.last = self.begins + last - 1

    def _first_row(self, start: Moment | None) -> int:
        """Returns the first row that is reached: by a given `ease`, or from `start`."""
        # only interpolated numbers decide
        starts = [] if start is None else np.array(start, np.float64).T.tolist()
        moves = [not each for each in self._switches]
        starts = [*compress(starts, moves)]
        rows = [*compress(self.rows.T.tolist(), moves)]
        rates = [each.rates for each in compress(self._limits, moves)]
        due = self._sent.due.tolist()
        row: int = _core.first_row(due, self._begins, self._sent.ease, starts, rows, rates)
        return row

    def places(self, start: Moment, most: int | None = None, row: int | None = None) -> Moment:
        """Returns places and derivatives (iterations, actuators) from the begin to the last row, at
        most `most` iterations.

        start: state in the previous iteration. row: first row that is reached, if it is known.
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
    """The plan of a chunk for one number, whether it was carried out or not."""

    begins: int  #: first iteration
    places: NDArray[np.float64]  #: (iterations,)
    derivatives: NDArray[np.float64]  #: (2, iterations): slopes [1/iteration] and curvatures


class ChunkEntries:
    """Journal entries that plans of chunks depend on; at most the newest `most`."""

    def __init__(self, most: int | None = None) -> None:
        self.entries: deque[JournalEntry] = deque(maxlen=most)

    def add(self, entries: Iterable[JournalEntry]) -> None:
        self.entries.extend(
            each
            for each in entries
            if each.kind == "chunk_begun" or any(one.pace == "chunk" for one in each.commands)
        )


def planned_by_chunks(
    entries: Iterable[JournalEntry], history: History
) -> dict[str, list[Planned]]:
    """Returns plans of the chunks that began in these rows, by number: "elbow", "elbow.position".

    Leaves out chunks that began before the oldest row, and iterations far beyond the newest row.
    """
    found: dict[str, list[Planned]] = {}
    if not len(history):
        return found
    columns = {each.name for each in columns_of(history.schema)}
    oldest, newest = int(history.iteration[0]), int(history.iteration[-1])
    # states that interpolate by themselves have no known plan
    blends = blending(history.schema)
    number_of: dict[str, Number] = {}
    for each in actuators_of(history.schema):
        number_of.update(zip(each.paths, each.numbers, strict=True))
    waiting: dict[tuple[int | None, int | None], JournalCommand] = {}
    for entry in entries:
        if entry.kind == "taken":
            waiting.update({(entry.lane, each.id): each for each in entry.commands if each.due})
        command = waiting.pop((entry.lane, entry.id), None) if entry.starts is not None else None
        begins = entry.iteration
        if command is None or not oldest < begins <= newest + 1:
            continue
        # numbers that switch have no start: their rows are held
        of_it = entry.starts or {}
        given = [each for each in _numbers(command, blends) if f"desired.{each[0]}" in columns]
        if not given:
            continue
        starts = [of_it.get(name, (0.0, 0.0, 0.0)) for name, _ in given]
        limits = [limits_of(number_of[name], rows.dtype, history.schema) for name, rows in given]
        anchor = command.anchor or 0
        sent = ChunkRows(
            anchor,
            np.array(command.due, np.int64) - anchor,
            1 if command.profile == "hold" else command.ease or 0,
            command.first or 0,
            np.stack([rows.astype(np.float64) for _, rows in given], axis=1),
        )
        switches = [name not in of_it for name, _ in given]
        decision = Decision(entry.shift or 0, begins)
        way = ChunkWay(sent, decision, command.profile, limits, switches)
        most = newest + MOST_AHEAD - begins
        plan = way.places(cast("Moment", tuple(np.array(starts).T)), most, entry.row)
        for i, (name, _) in enumerate(given):
            places, *derivatives = (each[:, i] for each in plan)
            found.setdefault(name, []).append(Planned(begins, places, np.array(derivatives)))
    return found


def _numbers(
    command: JournalCommand, blends: list[str]
) -> Iterable[tuple[str, NDArray[np.generic]]]:
    """Yields each number with its rows (rows,) in a command, except for blending actuators."""
    for actuator, target in zip(command.actuators, command.targets, strict=True):
        if actuator in blends:
            continue
        fields = target if isinstance(target, dict) else {"": target}
        for field, values in fields.items():
            rows = np.atleast_1d(np.asarray(values))
            if rows.ndim == 1 and rows.dtype.kind in "fiub":
                yield f"{actuator}.{field}" if field else actuator, rows
