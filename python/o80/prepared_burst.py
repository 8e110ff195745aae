"""A burst that is made again and again: what stays the same is checked and looked up once."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from o80 import _core
from o80.errors import InvalidArgument


class PreparedBurst:
    """Targets in, iterations, all their rows out; made by `Frontend.prepared_burst`.

    targets: (steps, actuators), to be filled before a run: numbers for states of one number, else
        structured. What is not filled of floats is not a number, and refused. Targets stay from run
        to run.
    rows: (iterations,), structured like `history().rows`: those of the last run, in the same
        memory every time. Copy what you keep.

    For loops that do the same thousands of times a second; one thread at a time.
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
        self.targets: NDArray[Any] = states.swapaxes(0, 1)
        self.rows = rows
        self._frontend = frontend
        steps = states.shape[1]
        self._run = _core.PreparedBurst(
            actuators, steps, *pace, states.view(np.uint8), rows.view(np.uint8)
        ).run

    def run(
        self, timeout: float | None = None, *, at: int | None = None, late: str = "reject"
    ) -> int:
        """Sends the targets, with what else was added, and bursts; fills `rows`.

        timeout: for the whole burst [s].
        at, late: as in `Frontend.burst`.

        Returns the iteration of the last row. Raises InvalidArgument for targets that the robot
        cannot follow, and what `Frontend.burst` raises.
        """
        return self._run(self._frontend, timeout, at, late)


def checked_count(count: int, name: str) -> int:
    """At least 1. Raises InvalidArgument."""
    if count < 1:
        raise InvalidArgument(f"{name} of a burst: {count}, at least 1 is needed")
    return count
