"""Bursts of two inline groups in one call: the second one follows what the first one did."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

import o80._core as _core
from o80.base.errors import InvalidArgument

if TYPE_CHECKING:
    from o80.group_burst import Copies, GroupBurst


class ChainedBurst:
    """A burst of a group and the burst of another one that follows it; from `GroupBurst.then`.

    In each copy, the first burst runs, numbers of its rows become targets of the second one (row i
    gives step i), and that runs. Targets and rows are those of the two bursts.
    """

    def __init__(
        self, first: GroupBurst, second: GroupBurst, numbers: str | Mapping[str, str]
    ) -> None:
        self._first, self._second = first, second
        feeds = list(_feeds(first.rows.dtype, second, numbers))
        self._chain = _core.GroupChain(second._plan, feeds)
        first._group.check_chain(first._plan, second._group, self._chain)

    @property
    def bursts(self) -> tuple[GroupBurst, GroupBurst]:
        """The first and the second."""
        return self._first, self._second

    def run(self, copies: Copies = None, *, timeout: float | None = None) -> None:
        """Runs both bursts of these copies; arguments and errors as `GroupBurst.run`.

        The burst of a copy that fails is not followed by its second one.
        """
        first, second = self._first, self._second
        chosen = first._chosen(copies)
        first._group.burst_chain(first._plan, second._group, self._chain, chosen, timeout)


def _feeds(
    rows: np.dtype[Any], second: GroupBurst, numbers: str | Mapping[str, str]
) -> Iterator[tuple[int, int, int, int]]:
    """Feed of each number of each actuator: offset in the row and in the targets, stride, size."""
    state = second.targets.dtype
    if second.targets.ndim == 1:
        raise InvalidArgument(
            "a burst that follows needs targets of one type: prepare it for actuators whose states "
            f"are alike, not for {', '.join(state.names or ())}"
        )
    steps, actuators = second.targets.shape[1:]
    if isinstance(numbers, str):
        if state.fields is not None:
            raise InvalidArgument(
                f"targets of several numbers need a path for each: {', '.join(state.fields)}"
            )
        numbers = {"": numbers}
    for field, path in numbers.items():
        wanted, to = (state, 0) if field == "" else _at(state, field, "field of the targets")
        found, at = _at(rows, path, "path in a row")
        if found.base != wanted or found.shape != (actuators,):
            raise InvalidArgument(
                f"'{path}' must have a {wanted} for each of {actuators} actuators, "
                f"it has {found.base} in the shape {found.shape}"
            )
        for actuator in range(actuators):
            place = actuator * steps * state.itemsize + to
            yield at + actuator * wanted.itemsize, place, state.itemsize, wanted.itemsize


def _at(dtype: np.dtype[Any], path: str, what: str) -> tuple[np.dtype[Any], int]:
    """Type and offset of a field below others, named with dots."""
    offset = 0
    for name in path.split("."):
        if dtype.fields is None or name not in dtype.fields:
            known = ", ".join(list(dtype.fields or ())[:5])
            raise InvalidArgument(f"there is no {what} '{path}': '{name}' is none of {known}")
        dtype, begin = dtype.fields[name][:2]
        offset += begin
    return dtype, offset
