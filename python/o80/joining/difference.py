"""Finds the first difference of two histories."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

import o80._core as _core
from o80.base.errors import InvalidArgument
from o80.rows.columns import columns_of, is_within
from o80.rows.history import History, columns_in

OF_THE_CLOCK = ("time", "lateness", "overruns", "skipped")
"""Columns that differ from run to run if the robot runs in real time."""
COUNT = "starvations"
"""Column with a count since the start of a run: a replay may begin later. Masks are compared."""


class RobotsDifferError(InvalidArgument):
    """Two histories are of robots with different descriptions."""


@dataclass(frozen=True)
class Difference:
    """First difference of two histories."""

    iteration: int
    field: str  #: "" if one of them lacks the row
    values: tuple[Any, Any]

    def __str__(self) -> str:
        if not self.field:
            there, missing = ("first", "second") if self.values[0] else ("second", "first")
            return f"iteration {self.iteration} is in the {there}, not in the {missing}"
        one, other = self.values
        return f"iteration {self.iteration}, {self.field}: {one!r} and {other!r}"


def first_difference(
    one: History,
    other: History,
    *,
    ignore: Sequence[str] = (),
    tolerances: Mapping[str, float] | None = None,
) -> Difference | None:
    """Finds the earliest iteration in which two histories differ; None if there is none.

    Numbers are compared bit for bit, except `starvations` and the fields of the clock: `time`,
    `lateness`, `overruns` and `skipped` of a robot in real time, and fields that its driver marks
    as fields of the clock.
    ignore: columns to leave out, such as "lateness" or "extended" (all sensor values). Only these
        may be missing in one history.
    tolerances: by column, likewise, the largest absolute difference that counts as equal.
    Raises InvalidArgument if the robots differ, or a column is unknown.
    """
    if one.schema["actuators"] != other.schema["actuators"]:
        raise RobotsDifferError("the robots differ: they have different actuators or limits")
    mine, others = columns_in(one), columns_in(other)
    every = dict.fromkeys([*mine, *others])
    for named in [*ignore, *(tolerances or {})]:
        if not any(is_within(column, named) for column in every):
            known = [name.partition(separator)[0] for separator in ".[" for name in every]
            instead = _core.names_instead(named, list(dict.fromkeys(known)))
            raise InvalidArgument(f"there is no column '{named}'{instead}")
    for column in every:
        if (column in mine) != (column in others) and not any(is_within(column, n) for n in ignore):
            raise RobotsDifferError(
                f"the robots differ in their fields: {column} is in one of them"
            )

    first, second, lacking = _rows_of_both(mine["iteration"], others["iteration"])
    found = [] if lacking is None else [lacking]
    real_time = "monotonic" in (one.schema["clock"], other.schema["clock"])
    left_out = [*ignore, COUNT, *(OF_THE_CLOCK if real_time else ())]
    left_out += [each.name for each in columns_of(one.schema) if each.origin == "clock"]
    for column in mine:
        if column == "iteration" or any(is_within(column, named) for named in left_out):
            continue
        tolerance = max(
            (value for named, value in (tolerances or {}).items() if is_within(column, named)),
            default=None,
        )
        a, b = mine[column][first], others[column][second]
        differs = np.flatnonzero(_differs(a, b, tolerance))
        if len(differs):
            at = int(differs[0])
            iteration = int(mine["iteration"][first][at])
            found.append(Difference(iteration, column, (a[at].item(), b[at].item())))
    return min(found, key=lambda each: each.iteration, default=None)


def _rows_of_both(
    one: NDArray[np.int64], other: NDArray[np.int64]
) -> tuple[NDArray[np.intp], NDArray[np.intp], Difference | None]:
    """Returns positions of common iterations in both, and the first that one of them lacks."""
    _, first, second = np.intersect1d(one, other, assume_unique=True, return_indices=True)
    alone = np.setxor1d(one, other, assume_unique=True)
    if not len(alone):
        return first, second, None
    iteration = int(alone[0])
    here = bool(np.isin(iteration, one))
    return first, second, Difference(iteration, "", (here, not here))


def _differs(a: NDArray[Any], b: NDArray[Any], tolerance: float | None) -> NDArray[np.bool_]:
    if a.dtype != b.dtype:
        raise RobotsDifferError(
            f"the robots differ: a number is {a.dtype} in one, {b.dtype} in the other"
        )
    if tolerance is not None:
        near = np.isclose(a.astype(float), b.astype(float), rtol=0, atol=tolerance, equal_nan=True)
        return ~np.asarray(near, np.bool_)
    bits = np.dtype(f"u{a.dtype.itemsize}")
    return np.asarray(a.view(bits) != b.view(bits), np.bool_)


def same_bytes(one: History, other: History) -> bool:
    """True if all rows are equal, except fields of the clock and of the world."""
    if one.rows.dtype != other.rows.dtype or len(one) != len(other):
        return False
    return bool(np.array_equal(_compared(one), _compared(other)))


def _compared(history: History) -> NDArray[Any]:
    """Returns the bytes of the rows, with zeros in fields that are not compared."""
    fields = history.rows.dtype.fields
    assert fields is not None
    rows = np.frombuffer(history.rows.tobytes(), np.uint8).reshape(len(history), -1).copy()
    for name in (COUNT, *(OF_THE_CLOCK if history.schema["clock"] == "monotonic" else ())):
        dtype, offset = fields[name][:2]
        rows[:, offset : offset + dtype.itemsize] = 0
    for column in columns_of(history.schema):
        if column.origin != "robot":
            rows[:, column.offset : column.offset + column.dtype.itemsize] = 0
    return rows
