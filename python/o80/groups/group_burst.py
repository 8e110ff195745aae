"""Repeatable bursts and requests of copies."""

import copy
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

import o80._core as _core
from o80.base.argument_checks import mapping
from o80.base.errors import InvalidArgument
from o80.frontend.prepared_burst import BurstArrays
from o80.rows.layout import field_at

#: Copies to act on: numbers, each once, a slice, or a mask with a bool for each copy; None: all.
Copies = ArrayLike | slice | None


class GroupBurst(BurstArrays):
    """A burst of copies: a PreparedBurst from `InlineGroup.prepared_burst`.

    targets: (copies, steps, actuators). If the states of the actuators are of several types:
        structured (copies,), with a field (steps,) for each actuator:
        `targets["gripper"][:, 0]`.
    rows: (copies, iterations), the rows of the last run of each copy.
    """

    def __init__(
        self, group: _core.InlineGroup, everybody: NDArray[np.uint32], *options: Any
    ) -> None:
        super().__init__(*options)
        self._group, self._everybody, self._all = group, everybody, everybody.view(np.uint8)
        group.check(self._compiled)

    def run(
        self,
        copies: Copies = None,
        *,
        instead: "tuple[Copies, GroupRequest] | None" = None,
        timeout: float | None = None,
    ) -> None:
        """Sends the targets, with all else that was added, and bursts; fills `rows`.

        copies: numbers of the copies that run, a slice, or a mask (None: all).
        instead: (copies, request). These copies run the request, such as a reset, in the same call
            in place of the burst. All their rows are then their newest row.
        timeout: for all copies together [s].

        Raises CopyFailed with the exception of each copy that failed (for example targets that the
        robot cannot follow, a halt, a driver fault); all others are done. All rows of a halted copy
        are its last row; rows of other failed copies are not valid. TimeoutError and Ctrl-C leave
        each copy between two iterations; some may not have run at all.
        """
        chosen = self._all
        if copies is not None:
            chosen = chosen_copies(copies, self._everybody).view(np.uint8)
        if instead is None:
            self._group.burst(self._compiled, chosen, timeout)
            return
        others, request = _mask(instead[0], self._everybody), instead[1]
        if request._group is not self._group:
            raise InvalidArgument("the request and the burst must be of the same group")
        if copies is not None:
            missing = np.setdiff1d(others.nonzero()[0], chosen.view(np.uint32))
            if missing.size:
                raise InvalidArgument(
                    f"copies {missing.tolist()} of `instead` must be among the copies that run"
                )
        payloads = request._payloads
        self._group.burst(self._compiled, chosen, timeout, others, request._request, payloads)

    def then(self, following: "GroupBurst", numbers: str | Mapping[str, str]) -> "GroupBurst":
        """Returns a burst that runs this one and then `following` of another group, copy by copy.

        numbers: for each field of the targets of `following` the path in the rows of this one
            that gives it: `{"position": "extended.joint_positions"}`; for targets of one number
            the path itself. Row i gives step i. Other fields keep their values.

        The other group has as many copies and shares the threads of this one (`threads=group`).

        The returned burst has the targets of this one and the rows of `following`. A copy that
        fails does not run `following`. Raises InvalidArgument if numbers and targets do not match.
        """
        feeds = list(_feeds(self._rows.dtype, following._targets, numbers))
        both = copy.copy(self)
        both._rows = following._rows
        both._compiled = _core.PreparedBurst(
            self._compiled, following._group, following._compiled, feeds
        )
        self._group.check(both._compiled)
        return both


class GroupRequest:
    """A repeatable request to copies, made by `InlineGroup.prepared_request`.

    fields: (copies,), structured: the fields of the request of each copy. They keep their values
        from run to run.
    rows: (copies,), structured like `history().rows`: the newest row of each copy after its last
        run. Every run overwrites the rows of its copies.
    """

    def __init__(
        self, group: _core.InlineGroup, request: int, fields: NDArray[Any], rows: NDArray[Any]
    ) -> None:
        self._group, self._request = group, request
        self._everybody = np.arange(len(rows), dtype=np.uint32)
        self._fields, self._payloads = fields, fields.view(np.uint8)
        self._rows, self._bytes = rows, rows.view(np.uint8)

    @property
    def fields(self) -> NDArray[Any]:
        """The fields of the request of each copy, (copies,)."""
        return self._fields

    @property
    def rows(self) -> NDArray[Any]:
        """The newest row of each copy after its last run, (copies,)."""
        return self._rows

    def run(self, copies: Copies = None, *, timeout: float | None = None) -> None:
        """Sends the request and runs each copy until its request has ended.

        copies: numbers of the copies, a slice, or a mask (None: all).
        timeout: for all copies together [s].

        Raises as `InlineGroup.request`.
        """
        chosen = chosen_copies(copies, self._everybody)
        payloads = self._fields[chosen].view(np.uint8)
        self._group.request(self._request, chosen.view(np.uint8), payloads, self._bytes, timeout)


def chosen_copies(copies: Copies, everybody: NDArray[np.uint32]) -> NDArray[np.uint32]:
    """Returns the numbers of the chosen copies. Raises InvalidArgument for a wrong choice."""
    if copies is None:
        return everybody
    if isinstance(copies, slice):
        return everybody if copies == slice(None) else np.ascontiguousarray(everybody[copies])
    given = np.asarray(copies)
    if given.dtype == np.bool_:
        if given.shape != everybody.shape:
            raise InvalidArgument(
                f"a mask of copies must have the shape {everybody.shape}, got {given.shape}"
            )
        return np.flatnonzero(given).astype(np.uint32)
    if given.ndim != 1 or (given.size and given.dtype.kind not in "iu"):
        raise InvalidArgument(
            f"copies must be a list of numbers of copies or a mask of bools, got {copies!r}"
        )
    if given.size:
        low, high = (given[0],) * 2 if given.size == 1 else (given.min(), given.max())
        if not 0 <= low <= high < len(everybody):
            raise InvalidArgument(f"there are copies 0 to {len(everybody) - 1}, got {copies!r}")
    return np.ascontiguousarray(given, np.uint32)


def _mask(copies: Copies, everybody: NDArray[np.uint32]) -> NDArray[np.bool_]:
    """Returns the choice as a mask (copies,). Raises InvalidArgument for a wrong choice."""
    given = copies if isinstance(copies, np.ndarray) else everybody
    if given.dtype == np.bool_ and given.shape == everybody.shape:
        return np.ascontiguousarray(given)
    mask = np.zeros(len(everybody), np.bool_)
    mask[chosen_copies(copies, everybody)] = True
    return mask


def _feeds(
    rows: np.dtype[Any], targets: NDArray[Any], numbers: str | Mapping[str, str]
) -> Iterator[tuple[int, int, int, int]]:
    """Yields row offset, target offset, stride and size of each number of each actuator."""
    state = targets.dtype
    if targets.ndim == 1:
        raise InvalidArgument(
            "a burst that follows another one needs targets of one type: prepare it for actuators "
            f"of one type, got {', '.join(state.names or ())}"
        )
    steps, actuators = targets.shape[1:]
    if isinstance(numbers, str):
        if state.fields is not None:
            raise InvalidArgument(
                f"targets of several numbers need a path for each: {', '.join(state.fields)}"
            )
        numbers = {"": numbers}
    for field, path in mapping(numbers, "numbers", "fields to paths").items():
        wanted, to = (state, 0) if field == "" else field_at(state, field, "field of the targets")
        found, at = field_at(rows, path)
        if found.base != wanted or found.shape != (actuators,):
            raise InvalidArgument(
                f"'{path}' must have a {wanted} for each of {actuators} actuators, "
                f"it has {found.base} in the shape {found.shape}"
            )
        for actuator in range(actuators):
            place = actuator * steps * state.itemsize + to
            yield at + actuator * wanted.itemsize, place, state.itemsize, wanted.itemsize
