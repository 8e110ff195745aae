"""A burst of the copies of an inline group that is repeated."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

import o80._core as _core
from o80.base.errors import InvalidArgument
from o80.chained_burst import ChainedBurst
from o80.prepared_burst import fill_targets

#: Numbers of copies, each once, a slice, or a mask with a bool for each copy; None: all of them.
Copies = ArrayLike | slice | None


class GroupBurst:
    """A burst that sends targets to copies and returns all rows; from `InlineGroup.prepared_burst`.

    targets: (copies, steps, actuators), to be filled before a run: numbers for states of one
        number, otherwise structured. Floats that are not filled are NaN and refused. Targets keep
        their values from run to run. An array that is assigned is copied into them.
        If the states of the actuators are of several types: structured (copies,), with a field
        (steps,) for each actuator: `targets["gripper"][:, 0]`.
    rows: (copies, iterations), structured like `history().rows`: the rows of the last run of each
        copy. Every run overwrites them: copy rows that you keep.
    """

    def __init__(
        self,
        group: _core.InlineGroup,
        actuators: list[int],
        states: NDArray[Any],
        rows: NDArray[Any],
        *,
        steps: int,
        pace: tuple[int, str, str, str, int],
        everybody: NDArray[np.uint32],
    ) -> None:
        states.view(np.uint8).fill(255)
        self._targets: NDArray[Any] = states if states.ndim == 1 else states.swapaxes(1, 2)
        self._rows = rows
        self._group = group
        self._everybody = everybody
        self._all = everybody.view(np.uint8)
        memory = states.view(np.uint8), rows.view(np.uint8)
        self._plan = _core.GroupPlan(actuators, steps, *pace, rows.shape[1], *memory)
        group.check(self._plan)

    @property
    def targets(self) -> NDArray[Any]:
        """The targets of the next run, (copies, steps, actuators), or (copies,): see the class."""
        return self._targets

    @targets.setter
    def targets(self, values: ArrayLike) -> None:
        axes = "(copies,)" if self._targets.ndim == 1 else "(copies, steps, actuators)"
        fill_targets(self._targets, values, axes)

    @property
    def rows(self) -> NDArray[Any]:
        """The rows of the last run of each copy, (copies, iterations)."""
        return self._rows

    def run(self, copies: Copies = None, *, timeout: float | None = None) -> None:
        """Sends the targets, with all else that was added, and bursts; fills `rows`.

        copies: numbers of the copies that run, a slice, or a mask (None: all).
        timeout: for all of them together [s].

        Raises CopyFailed with the exception of each copy that failed (for example targets that the
        robot cannot follow, a halt, a fault of its driver); all others are done, and the rows of
        those that failed are not valid. TimeoutError and
        Ctrl-C leave each copy between two iterations; some have not run at all then.
        """
        self._group.burst(self._plan, self._chosen(copies), timeout)

    def then(self, following: GroupBurst, numbers: str | Mapping[str, str]) -> ChainedBurst:
        """This burst and one of another group that follows it, copy by copy, in one call.

        numbers: for each field of the targets of `following` the path in the rows of this one
            that gives it: `{"position": "extended.joint_positions"}`; for targets of one number
            the path itself. Row i gives step i. Other fields keep their values.

        The other group has as many copies and shares the threads of this one (`threads=group`).
        Raises InvalidArgument.
        """
        return ChainedBurst(self, following, numbers)

    def _chosen(self, copies: Copies) -> NDArray[np.uint8]:
        if copies is None:
            return self._all
        return chosen_copies(copies, self._everybody).view(np.uint8)


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
