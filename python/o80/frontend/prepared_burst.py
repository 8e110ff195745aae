"""Repeatable bursts: options are checked and buffers are found once."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

import o80._core as _core
from o80.base.argument_checks import whole
from o80.base.errors import InvalidArgument
from o80.base.words import LateWord, ModeWord, ProfileWord, StartWord
from o80.rows.enumerations import labelled, numbers_of
from o80.rows.layout import Layout
from o80.rows.targets import labels_of, state_types, states_from

#: Axes of targets, by the number of axes.
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
        """copies: (number of copies,); () for a single robot."""
        count = whole(iterations, "iterations of a burst", 1)
        steps = whole(steps, "steps of a burst", 1)
        states = _states(layout, copies, actuators, steps)
        states.view(np.uint8).fill(255)
        if states.ndim == 1:  # of several types: a field for each actuator
            self._targets = states if copies else states.reshape(())
        else:
            self._targets = states.swapaxes(-1, -2)
        self._rows: NDArray[Any] = np.zeros((*copies, count), layout.row)
        options = _core.CommandOptions(
            iterations=whole(each, "each of a burst", 1), mode=mode, profile=profile, start=start
        )
        memory = states.view(np.uint8), self._rows.view(np.uint8)
        self._compiled = _core.PreparedBurst(actuators, steps, options, delay, count, *memory)

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
        otherwise structured; where actuators have several types, with a field for each, as in
        `targets["gripper"]`. Floats that are not filled are NaN and refused. Targets keep their
        values from run to run. An array that is assigned is copied into them.
    rows: (iterations,), structured like `history().rows`: the rows of the last run. Every run
        overwrites them: copy rows that you keep.

    For loops that repeat a burst thousands of times a second; one thread at a time.
    """

    def __init__(self, frontend: _core.Frontend, *options: Any) -> None:
        super().__init__(*options)
        self._frontend, self._run = frontend, self._compiled.run

    def run(
        self,
        timeout: float | None = None,
        *,
        at: int | None = None,
        late: LateWord = "reject",
        seen: _core.Observation | _core.Seen | None = None,
    ) -> int:
        """Sends the targets, with all added commands, and bursts; fills `rows`.

        timeout: for the whole burst [s].
        at, late, seen: as in `Frontend.burst`.

        Returns the iteration of the last row. Raises InvalidArgument for targets that the robot
        cannot follow, and the exceptions of `Frontend.burst`.
        """
        return self._run(self._frontend, timeout, at, late, seen)


def _states(
    layout: Layout, copies: tuple[int, ...], actuators: list[int], steps: int
) -> NDArray[Any]:
    """Allocates targets: in each copy, all steps of the first actuator, then of the second, ..."""
    if copies and not actuators:
        return np.empty((*copies, 0, steps))  # it only runs them
    kinds = state_types(actuators, layout)
    if len(set(kinds)) > 1:
        names = [layout.schema["actuators"][actuator]["name"] for actuator in actuators]
        columns = [(name, kind, (steps,)) for name, kind in zip(names, kinds, strict=True)]
        return np.empty(copies or (1,), np.dtype(columns))
    states = np.empty((*copies, len(actuators), steps), kinds[0])
    return labelled(states, labels_of(actuators[0], layout))
