"""Selects the numbers of several actuators that rows of targets contain."""

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from o80.rows.actuators import actuators_of, blending
from o80.rows.columns import numbers_below
from o80.rows.layout import Layout, dtype_of_type
from o80.rows.plans import NumberLimits, limits_of


class _Number(NamedTuple):
    place: int  # of its actuator among those that were chosen
    kind: np.dtype[Any]
    offset: int  # in the state [bytes]
    nth: int  # in the state
    switches: bool  # it is not interpolated


class GivenNumbers:
    """Numbers in the states of several actuators: all numbers, or those with a bit in a mask.

    masks: words of each actuator in turn, as returned by `states_of`; empty: all numbers.
    """

    def __init__(self, actuators: Sequence[int], masks: Sequence[int], layout: Layout) -> None:
        schema = layout.schema
        rows = [schema["actuators"][each] for each in actuators]
        types = [schema["groups"][row["group"]]["type"] for row in rows]
        self._sizes = [dtype_of_type(each).itemsize for each in types]
        blends = blending(schema)
        #: the first actuator whose state interpolates by itself; empty: none
        self.blends = next((row["name"] for row in rows if row["name"] in blends), "")
        words = iter(masks)
        self._numbers: list[_Number] = []
        for place, described in enumerate(types):
            numbers = [
                _Number(
                    place,
                    each.dtype,
                    each.offset,
                    nth,
                    each.dtype.kind == "b" or each.labels is not None,
                )
                for nth, each in enumerate(numbers_below(described))
            ]
            count = -(-len(numbers) // 64)
            bits = sum(next(words) << 64 * i for i in range(count)) if masks else -1
            self._numbers += [each for each in numbers if bits >> each.nth & 1]
        #: place of the actuator of each number
        self.places = np.array([each.place for each in self._numbers], np.intp)
        #: actuator of each number, and its index in the state
        self.keys = [(actuators[each.place], each.nth) for each in self._numbers]
        self.switches = [each.switches for each in self._numbers]
        known = actuators_of(schema)
        self.limits: list[NumberLimits] = [
            limits_of(known[actuators[each.place]].numbers[each.nth], each.kind, schema)
            for each in self._numbers
        ]
        begin = schema["row"]["desired"]
        self._in_row = [begin + rows[each.place]["offset"] + each.offset for each in self._numbers]

    def _columns(self, states: NDArray[np.uint8], rows: int) -> Iterator[NDArray[Any]]:
        begins = np.cumsum([0, *(size * rows for size in self._sizes)])
        for place, kind, offset, *_ in self._numbers:
            at = int(begins[place]) + offset
            yield np.ndarray((rows,), kind, states.data, at, (self._sizes[place],))

    def values(self, states: NDArray[np.uint8], rows: int) -> NDArray[np.float64]:
        """Reads the numbers (rows, numbers) from the states of `states_of`."""
        columns = [each.astype(np.float64) for each in self._columns(states, rows)]
        return np.array(columns, np.float64).reshape(len(columns), rows).T

    def put(self, values: NDArray[np.float64], states: NDArray[np.uint8]) -> None:
        """Writes numbers (rows, numbers) to such states."""
        for column, new in zip(self._columns(states, len(values)), values.T, strict=True):
            column[...] = np.rint(new) if column.dtype.kind in "iub" else new

    def desired(self, row: Any) -> NDArray[np.float64]:
        """Reads the desired values (numbers,) from the memory of an observation."""
        numbers = zip(self._numbers, self._in_row, strict=True)
        return np.array([np.ndarray((), each.kind, row, at) for each, at in numbers], np.float64)
