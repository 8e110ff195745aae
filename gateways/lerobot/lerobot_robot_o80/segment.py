"""Reads an o80 segment in LeRobot's names and units."""

import contextlib
from collections.abc import Mapping
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

import o80
from o80.base.errors import sentence
from o80.datasets.lerobot_numbers import Number, numbers_of
from o80.rows.columns import value_of


class Segment:
    """Observed and desired numbers of a segment, by LeRobot's names.

    name: of the segment. units: "degrees", "normalised" or "native"; "": the units of LeRobot's
    driver for this arm, else "native". timeout: of the robot, and of its next row [s].
    """

    def __init__(self, name: str, units: str, timeout: float) -> None:
        self.name = name
        self.arm: o80.Frontend | None = None  #: None while closed
        self._units: Any = units or None
        self._timeout = timeout
        self._numbers: dict[str, dict[str, Number]] | None = None

    def numbers(self, part: Literal["observed", "desired"] = "observed") -> Mapping[str, Number]:
        """Returns the numbers by name; attaches briefly if the segment is not open.

        Raises TimeoutError without the robot, InvalidArgument for unsupported units.
        """
        if self._numbers is None:
            with o80.Frontend(self.name, self._timeout, read_only=True) as reader:
                self._describe(reader)
        assert self._numbers is not None
        return self._numbers[part]

    def _describe(self, arm: o80.Frontend) -> None:
        self._numbers = {
            part: {each.name: each for each in numbers_of(arm.schema, part, self._units)}
            for part in ("observed", "desired")
        }

    def open(self, *, read_only: bool = False) -> o80.Frontend:
        """Attaches. Raises TimeoutError without the robot, InvalidArgument for a bursting one."""
        arm = o80.Frontend(self.name, self._timeout, read_only=read_only, on_error="continue")
        try:
            if arm.bursting:
                raise o80.InvalidArgument(
                    f"'{self.name}' is bursting, but LeRobot requests no bursts: start it in real "
                    "time"
                )
            self._describe(arm)
        except BaseException:
            arm.close()
            raise
        self.arm = arm
        return arm

    def close(self) -> None:
        """Detaches. May be called twice."""
        arm, self.arm = self.arm, None
        if arm is not None:
            arm.close()

    def read(self) -> tuple[o80.Observation, dict[str, float]]:
        """Returns the newest row, and its observed numbers in LeRobot's units.

        Raises BackendGone if the robot has ended, BackendHalted with the text of the halt, and
        TimeoutError if the newest row is older than `timeout`.
        """
        arm = self.checked()
        if (age := arm.row_age or 0.0) > self._timeout:
            raise o80.TimeoutError(f"'{self.name}' has had no row for {age:.1f} s: see `o80 list`")
        row = arm.latest()
        found = {
            name: float(number.of_row(value_of(row, number.column)))
            for name, number in self.numbers().items()
        }
        return row, found

    def targets(self, actions: ArrayLike) -> NDArray[np.float64]:
        """Converts actions (n, numbers) from LeRobot's units to clamped targets for `chunks`."""
        numbers = self.numbers("desired").values()
        rows = np.asarray(actions, np.float64) / [number.scale for number in numbers]
        bounds = np.array([(number.minimum, number.maximum) for number in numbers]).T
        targets: NDArray[np.float64] = np.clip(rows, *bounds)
        return targets

    def checked(self) -> o80.Frontend:
        """Returns the frontend. Raises BackendGone or BackendHalted if the robot is not running."""
        assert self.arm is not None
        with contextlib.suppress(o80.TimeoutError):  # raises if the robot has ended
            self.arm.wait_for(self.arm.published + 1, 0.0)
        if (halt := self.arm.halted) is not None:
            raise o80.BackendHalted(
                f"'{self.name}' is halted: {sentence(halt.text or halt.cause)} When the cause is "
                f"gone: o80 resume {self.name} {halt.number}"
            )
        return self.arm
