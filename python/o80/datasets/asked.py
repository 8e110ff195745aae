"""Reads the targets of commands in each iteration from the journal of a recording."""

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

import o80._core as _core
from o80.base.words import Reason
from o80.rows.columns import Column, columns_of_part

_Piece = tuple[int, float]  # first iteration, value


class Asked:
    """Targets of the newest command for each number.

    A target counts from the iteration in which its command is taken. A row of a chunk or a
    trajectory counts until the iteration in which it is due. A batch that a halt rejects counts
    too. A purge and a fresh start end all targets.
    """

    def __init__(self, entries: Iterable[_core.JournalEntry], schema: Mapping[str, Any]) -> None:
        self._period = int(schema["period"])
        begin = schema["row"]["desired"]
        self._numbers: list[list[tuple[Column, int]]] = []  # numbers of each actuator
        columns = columns_of_part(schema, "desired")
        for actuator in schema["actuators"]:
            count = len(actuator["limits"])
            self._numbers.append(
                [(each, each.offset - begin - actuator["offset"]) for each in columns[:count]]
            )
            del columns[:count]
        self._pieces: dict[str, list[_Piece]] = defaultdict(list)
        for entry in entries:
            self._add(entry)

    def at(self, iterations: NDArray[np.int64], columns: Sequence[Column]) -> NDArray[np.float64]:
        """Returns targets (T, columns) in these iterations; NaN where there was none."""
        found = np.full((len(iterations), len(columns)), np.nan)
        for i, column in enumerate(columns):
            pieces = self._pieces[column.name]
            if not pieces:
                continue
            begins, values = (np.array(each) for each in zip(*pieces, strict=True))
            place = np.searchsorted(begins, iterations, side="right") - 1
            found[:, i] = np.where(place >= 0, values[place], np.nan)
        return found

    def _add(self, entry: _core.JournalEntry) -> None:
        if entry.kind == "fresh_start":
            for pieces in self._pieces.values():
                _end_at(pieces, entry.iteration)
        rejected = entry.kind == "rejected" and entry.reason == Reason.HALTED
        if entry.kind != "taken" and not rejected:
            return
        for record in entry.records:
            if record.kind == "purge" and not record.only_own:
                every = record.actuator >= len(self._numbers)
                for numbers in self._numbers if every else [self._numbers[record.actuator]]:
                    for column, _ in numbers:
                        _end_at(self._pieces[column.name], entry.iteration)
            elif record.kind == "command":
                self._command(record, entry.iteration)

    def _command(self, record: _core.JournalRecord, taken: int) -> None:
        begins = self._begins(record, taken)
        used = begins < np.append(begins[1:], np.iinfo(np.int64).max)  # late rows are skipped
        for target in record.targets:
            states = np.frombuffer(target.states, np.uint8).reshape(max(1, record.rows), -1)
            for i, (column, offset) in enumerate(self._numbers[target.actuator]):
                if any(target.mask) and not target.mask[i // 64] >> i % 64 & 1:
                    continue
                raw = states[:, offset : offset + column.dtype.itemsize]
                values = np.ascontiguousarray(raw).view(column.dtype)[:, 0].astype(np.float64)
                pieces = self._pieces[column.name]
                while pieces and pieces[-1][0] >= begins[0]:
                    pieces.pop()
                pieces += zip(begins[used].tolist(), values[used].tolist(), strict=True)

    def _begins(self, record: _core.JournalRecord, taken: int) -> NDArray[np.int64]:
        """Returns the first iteration (rows,) in which each row is the target."""
        rows = max(1, record.rows)
        if record.pace == "chunk":
            due = record.anchor + np.array(record.due, np.int64)
        elif rows == 1:
            due = np.zeros(1, np.int64)
        elif record.row_times:
            due = taken + np.array(record.row_times, np.int64) // self._period
        else:  # at a speed, due times of rows are unknown: one iteration each
            each = record.amount if record.pace == "iterations" else 1
            due = taken + each * np.arange(1, rows + 1) - 1
        begins: NDArray[np.int64] = np.maximum(np.append(taken, due[:-1] + 1), taken)
        return begins


def _end_at(pieces: list[_Piece], iteration: int) -> None:
    while pieces and pieces[-1][0] >= iteration:
        pieces.pop()
    pieces.append((iteration, np.nan))
