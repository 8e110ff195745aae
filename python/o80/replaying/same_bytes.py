"""A fast comparison of rows, for runs that are identical."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from o80.joining.difference import OF_THE_CLOCK
from o80.rows.columns import columns_of

if TYPE_CHECKING:
    from o80.rows.history import History


def same_bytes(one: History, other: History) -> bool:
    """True if all rows are equal, but for the fields of the clock and of the world."""
    if one.rows.dtype != other.rows.dtype or len(one) != len(other):
        return False
    return bool(np.array_equal(_compared(one), _compared(other)))


def _compared(history: History) -> NDArray[Any]:
    """The bytes of the rows, with zeros where they are not compared."""
    fields = history.rows.dtype.fields
    assert fields is not None
    rows = np.frombuffer(history.rows.tobytes(), np.uint8).reshape(len(history), -1).copy()
    if history.schema["clock"] == "monotonic":
        for name in OF_THE_CLOCK:
            dtype, offset = fields[name][:2]
            rows[:, offset : offset + dtype.itemsize] = 0
    for column in columns_of(history.schema):
        if column.origin != "robot":
            rows[:, column.offset : column.offset + column.dtype.itemsize] = 0
    return rows
