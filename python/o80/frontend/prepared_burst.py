"""Bursts and requests that are repeated: options are checked and buffers looked up once."""

from __future__ import annotations

import copy
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

import o80._core as _core
from o80.base.argument_checks import mapping, whole
from o80.base.errors import InvalidArgument
from o80.base.words import LateWord, ModeWord, ProfileWord, StartWord
from o80.rows.enumerations import labelled, numbers_of
from o80.rows.layout import Layout, field_at
from o80.rows.targets import common_labels, common_type, state_types, states_from

#: Numbers of copies, each once, a slice, or a mask with a bool for each copy; None: all of them.
Copies = ArrayLike | slice | None

#: Axes of targets, by their number.
_AXES = {1: "(copies,)", 2: "(steps, actuators)", 3: "(copies, steps, actuators)"}


class BurstArrays:
    """Targets and rows of a prepared burst."""

    def __init__(
        self,
        layout: Layout,
        copies: tuple[int, ...],
        actuators: list[int],
        iterations: int,
        steps: int,
        each: int,
        mode: ModeWord,
        profile: ProfileWord,
        start: StartWord,
        delay: int,
    ) -> None:
        """copies: their number; () for a single robot."""
        count, steps = _checked(iterations, "iterations"), _checked(steps, "steps")
        states = _states(layout, copies, actuators, steps)
        states.view(np.uint8).fill(255)
        self._targets = states if states.ndim == 1 else states.swapaxes(-1, -2)
        self._rows: NDArray[Any] = np.zeros((*copies, count), layout.row)
        each = _checked(each, "each")
        memory = states.view(np.uint8), self._rows.view(np.uint8)
        self._compiled = _core.PreparedBurst(
            actuators, steps, each, mode, profile, start, delay, count, *memory
        )

    @property
    def targets(self) -> NDArray[Any]:
        """Targets of the next run, (steps, actuators); of copies: see `GroupBurst`."""
        return self._targets

    @targets.setter
    def targets(self, values: ArrayLike) -> None:
        wanted, shape = self._targets.dtype, self._targets.shape
        if wanted.names is None:
            given = np.asarray(numbers_of(getattr(self._targets, "_labels", None), values))
        else:
            given = states_from(values, wanted)
        if given.shape != shape:
            axes = _AXES[len(shape)]
            raise InvalidArgument(
                f"targets must have the shape {axes} = {shape}, got {given.shape}"
            )
        if wanted.names is None and not np.can_cast(given.dtype, wanted, "same_kind"):
            raise InvalidArgument(f"targets must have dtype {wanted}, got {given.dtype}")
        self._targets[...] = given

    @property
    def rows(self) -> NDArray[Any]:
        """Rows of the last run, (iterations,); of copies (copies, iterations)."""
        return self._rows


class PreparedBurst(BurstArrays):
    """A burst that sends targets and returns all rows; made by `Frontend.prepared_burst`.

    targets: (steps, actuators), to be filled before a run: numbers for states of one number,
        otherwise structured. Floats that are not filled are NaN and refused. Targets keep their
        values from run to run. An array that is assigned is copied into them.
    rows: (iterations,), structured like `history().rows`: the rows of the last run. Every run
        overwrites them: copy rows that you keep.

    For loops that repeat a burst thousands of times a second; one thread at a time.
    """

    def __init__(self, frontend: _core.Frontend, *options: Any) -> None:
        super().__init__(*options)
        self._frontend, self._run = frontend, self._compiled.run

    def run(
        self, timeout: float | None = None, *, at: int | None = None, late: LateWord = "reject"
    ) -> int:
        """Sends the targets, with all else that was added, and bursts; fills `rows`.

        timeout: for the whole burst [s].
        at, late: as in `Frontend.burst`.

        Returns the iteration of the last row. Raises InvalidArgument for targets that the robot
        cannot follow, and the exceptions of `Frontend.burst`.
        """
        return self._run(self._frontend, timeout, at, late)


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

    def run(self, copies: Copies = None, *, timeout: float | None = None) -> None:
        """Sends the targets, with all else that was added, and bursts; fills `rows`.

        copies: numbers of the copies that run, a slice, or a mask (None: all).
        timeout: for all of them together [s].

        Raises CopyFailed with the exception of each copy that failed (for example targets that the
        robot cannot follow, a halt, a fault of its driver); all others are done, and the rows of
        those that failed are not valid. TimeoutError and
        Ctrl-C leave each copy between two iterations; some have not run at all then.
        """
        chosen = self._all
        if copies is not None:
            chosen = chosen_copies(copies, self._everybody).view(np.uint8)
        self._group.burst(self._compiled, chosen, timeout)

    def then(self, following: GroupBurst, numbers: str | Mapping[str, str]) -> GroupBurst:
        """This burst and one of another group that follows it, copy by copy, in one call.

        numbers: for each field of the targets of `following` the path in the rows of this one
            that gives it: `{"position": "extended.joint_positions"}`; for targets of one number
            the path itself. Row i gives step i. Other fields keep their values.

        The other group has as many copies and shares the threads of this one (`threads=group`).

        Returns a burst with the targets of this one and the rows of `following`. The burst of a
        copy that fails is not followed. Raises InvalidArgument.
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
    """A request that is sent to copies again and again; from `InlineGroup.prepared_request`.

    fields: (copies,), structured: the fields of the request of each copy. They keep their values
        from run to run.
    rows: (copies,), structured like `history().rows`: the newest row of each copy after its last
        run. Every run overwrites those of its copies.
    """

    def __init__(
        self, group: _core.InlineGroup, request: int, fields: NDArray[Any], rows: NDArray[Any]
    ) -> None:
        self._group, self._request = group, request
        self._everybody = np.arange(len(rows), dtype=np.uint32)
        self._fields, self._rows, self._bytes = fields, rows, rows.view(np.uint8)

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
        timeout: for all of them together [s].

        Raises as `InlineGroup.request`.
        """
        chosen = chosen_copies(copies, self._everybody)
        payloads = self._fields[chosen].view(np.uint8)
        self._group.request(self._request, chosen.view(np.uint8), payloads, self._bytes, timeout)


def chosen_copies(copies: Copies, everybody: NDArray[np.uint32]) -> NDArray[np.uint32]:
    """Numbers of copies. Raises InvalidArgument."""
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
    if given.size and not 0 <= given.min() <= given.max() < len(everybody):
        raise InvalidArgument(f"there are copies 0 to {len(everybody) - 1}, got {copies!r}")
    return np.ascontiguousarray(given, np.uint32)


def _checked(count: int, name: str) -> int:
    """At least 1. Raises InvalidArgument."""
    return whole(count, f"{name} of a burst", 1)


def _states(
    layout: Layout, copies: tuple[int, ...], actuators: list[int], steps: int
) -> NDArray[Any]:
    """Memory for targets: in each copy those of the first actuator, then of the second, ..."""
    kinds = state_types(actuators, layout)
    if copies and len(set(kinds)) > 1:
        names = [layout.schema["actuators"][actuator]["name"] for actuator in actuators]
        columns = [(name, kind, (steps,)) for name, kind in zip(names, kinds, strict=True)]
        return np.empty(copies, np.dtype(columns))
    states = np.empty((*copies, len(actuators), steps), common_type(actuators, layout))
    known: NDArray[Any] = labelled(states, common_labels(actuators, layout))
    return known


def _feeds(
    rows: np.dtype[Any], targets: NDArray[Any], numbers: str | Mapping[str, str]
) -> Iterator[tuple[int, int, int, int]]:
    """Feed of each number of each actuator: offset in the row and in the targets, stride, size."""
    state = targets.dtype
    if targets.ndim == 1:
        raise InvalidArgument(
            "a burst that follows needs targets of one type: prepare it for actuators whose states "
            f"are alike, not for {', '.join(state.names or ())}"
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
