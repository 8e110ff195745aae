"""A burst that is repeated: its options are checked and its buffers looked up once."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

import o80._core as _core
from o80.base.argument_checks import whole
from o80.base.errors import InvalidArgument
from o80.base.words import LateWord
from o80.rows.enumerations import numbers_of
from o80.rows.targets import states_from


class PreparedBurst:
    """A burst that sends targets and returns all rows; made by `Frontend.prepared_burst`.

    targets: (steps, actuators), to be filled before a run: numbers for states of one number,
        otherwise structured. Floats that are not filled are NaN and refused. Targets keep their
        values from run to run. An array that is assigned is copied into them.
    rows: (iterations,), structured like `history().rows`: the rows of the last run. Every run
        overwrites them: copy rows that you keep.

    For loops that repeat a burst thousands of times a second; one thread at a time.
    """

    def __init__(
        self,
        frontend: _core.Frontend,
        actuators: list[int],
        states: NDArray[Any],
        rows: NDArray[Any],
        *,
        pace: tuple[int, str, str, str],
    ) -> None:
        states.view(np.uint8).fill(255)
        self._targets: NDArray[Any] = states.swapaxes(0, 1)
        self._rows = rows
        self._frontend = frontend
        steps = states.shape[1]
        self._run = _core.PreparedBurst(
            actuators, steps, *pace, states.view(np.uint8), rows.view(np.uint8)
        ).run

    @property
    def targets(self) -> NDArray[Any]:
        """The targets of the next run, (steps, actuators)."""
        return self._targets

    @targets.setter
    def targets(self, values: ArrayLike) -> None:
        fill_targets(self._targets, values, "(steps, actuators)")

    @property
    def rows(self) -> NDArray[Any]:
        """The rows of the last run, (iterations,)."""
        return self._rows

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


def checked_count(count: int, name: str) -> int:
    """At least 1. Raises InvalidArgument."""
    return whole(count, f"{name} of a burst", 1)


def fill_targets(targets: NDArray[Any], values: ArrayLike, axes: str) -> None:
    """Copies values into the targets of a prepared burst. axes: for an error, as "(steps, ...)".

    Raises InvalidArgument.
    """
    wanted = targets.dtype
    if wanted.names is None:
        given = np.asarray(numbers_of(getattr(targets, "_labels", None), values))
    else:
        given = states_from(values, wanted)
    if given.shape != targets.shape:
        raise InvalidArgument(
            f"targets must have the shape {axes} = {targets.shape}, got {given.shape}"
        )
    if wanted.names is None and not np.can_cast(given.dtype, wanted, "same_kind"):
        raise InvalidArgument(f"targets must have dtype {wanted}, got {given.dtype}")
    targets[...] = given
