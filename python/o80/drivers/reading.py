"""Arguments of a driver's methods: the desired states to write, and a reading to fill."""

import warnings
from collections.abc import Callable, Sequence
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

import o80._core as _core
from o80.base import argument_checks
from o80.base.errors import InvalidArgument
from o80.drivers.backend import Answer, StartAfresh, check_end, fill
from o80.drivers.description import numbered
from o80.rows.layout import Layout

#: computes differences of numbers from their offsets in the desired block, and an order
Differences = Callable[[list[int], int], list[float]]


class DriverFaultError(Exception):
    """Ends the loop; see `Reading.fault`."""


class Desired:
    """Desired states of an iteration. The next one overwrites the arrays: copy them to keep."""

    def __init__(self, layout: Layout, block: NDArray[Any], active: NDArray[np.uint8]) -> None:
        self._layout = layout
        self._block = block
        self._words = active
        self.iteration = 0
        self.time = 0  #: [ns]
        self.period = 0.0  #: [s]
        self.differences: Differences

    @property
    def states(self) -> Any:
        """An array (actuators,), or a record of groups of actuators."""
        return self._layout.of_states(self._block)

    @property
    def active(self) -> NDArray[np.bool_]:
        """(actuators,) True where a command or braking gives the state."""
        return self._layout.mask_in(self._words)

    def rate(self, field: str | None = None) -> NDArray[np.float64]:
        """Velocities of the desired states, for feed-forward [unit/s], in write() only.

        Each is the difference to the last iteration divided by the period, so that the sum of
        velocities times period is the position; 0 for actuators that are not `active`.

        field: of states that are structs: "angle", or with its group "arm.angle"
        Returns: (actuators,), and the shape of the field
        """
        return self._differences(field, 1) / self.period

    def rate2(self, field: str | None = None) -> NDArray[np.float64]:
        """Accelerations [unit/s^2]: as `rate`, the differences of the velocities."""
        return self._differences(field, 2) / self.period**2

    def _differences(self, field: str | None, order: int) -> NDArray[np.float64]:
        view = self._block
        for name in field.split(".") if field else ():
            known = view.dtype.names or ()
            if name not in known:
                instead = _core.names_instead(name, [*known])
                raise InvalidArgument(f"the desired states have no field {name!r}{instead}")
            view = view[name]
        if view.dtype.names:
            raise InvalidArgument(
                f"rate() and rate2() need one field of a state: {', '.join(view.dtype.names)}"
            )
        first = view.__array_interface__["data"][0] - self._block.__array_interface__["data"][0]
        places = np.full(view.shape, first)
        for axis, stride in enumerate(view.strides):
            along = stride * np.arange(view.shape[axis])
            places += along.reshape([-1 if i == axis else 1 for i in range(view.ndim)])
        found = self.differences(places.ravel().tolist(), order)
        return np.array(found).reshape(view.shape)

    def __getitem__(self, index: Any) -> Any:
        return self.states[index]

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        return np.array(self._block, dtype=dtype, copy=copy)


class Reading:
    """Reading of an iteration: fill `observed` and `extended`; they hold the last reading."""

    def __init__(
        self,
        observed: NDArray[Any],
        extended: NDArray[Any],
        desired: NDArray[Any],
        actuators: Sequence[str],
        requests: Sequence[str],
    ) -> None:
        self._observed = observed
        self._extended = extended
        self._desired = desired
        self._actuators = actuators
        self._requests = requests
        self.begin(0, 0, False, [])

    def begin(self, iteration: int, time: int, fresh: bool, runs: Sequence[bool]) -> None:
        """Begins a new reading."""
        self.iteration = iteration
        self.time = time  #: time of the row [ns]
        self.fresh = fresh
        """True in the reading of a fresh start: after a reset or a resume. Not in row 0."""
        self._runs = runs
        self._finished = self._missed = self._has_desired = self._follows = False
        self._halt: str | None = None
        self._interrupted: list[int] = []
        self._reports: list[tuple[int, int, str]] = []

    @property
    def observed(self) -> NDArray[Any]:
        """(actuators,), or a structured array of groups: assign to it, or to its elements."""
        return self._observed

    @observed.setter
    def observed(self, values: Any) -> None:
        fill(self._observed, values, "observed")

    @property
    def extended(self) -> NDArray[Any]:
        """The sensor values: `reading.extended["force"] = ...`, or a mapping for all of them."""
        return self._extended

    @extended.setter
    def extended(self, values: Any) -> None:
        fill(self._extended, values, "extended")

    def halt(self, reason: str) -> None:
        """Halts the robot. May be repeated in each reading; an equal text is the same halt."""
        self._halt = _core.printable(reason)
        if not isinstance(cast(object, reason), str):  # an exception would end the loop instead
            warnings.warn(
                f"the reason of reading.halt must be a string, got {self._halt}",
                RuntimeWarning,
                stacklevel=2,
            )

    def fault(self, reason: str) -> None:
        """Ends the loop at once; frontends raise the reason."""
        raise DriverFaultError(argument_checks.text(reason, "the reason of reading.fault"))

    def finish(self) -> None:
        """Ends the loop in order: in real time the robot brakes first."""
        self._finished = True

    def missed(self) -> None:
        """Reports that this tick brought no reading: it counts as an overrun."""
        self._missed = True

    def interrupt(self, actuator: int | str) -> None:
        """Ends the commands of an actuator as interrupted."""
        self._interrupted.append(numbered(actuator, self._actuators, "actuator"))

    def go_on_from(self, desired: Any) -> None:
        """Sets the desired states of a fresh start, instead of the observed ones."""
        fill(self._desired, desired, "desired")
        self._has_desired = True

    def follow(self) -> None:
        """Lets all actuators without a command follow from this fresh start until the next one."""
        self._follows = True

    def runs(self, request: str) -> bool:
        """True if a request was answered with o80.Running and has not ended."""
        return self._runs[numbered(request, self._requests, "request")]

    def progress(self, request: str, text: str) -> None:
        """Sets the text that frontends see while a request runs: at most 247 bytes."""
        self._report(request, Answer.RUNNING, argument_checks.text(text, "reading.progress"))

    def ended(
        self, request: str, answer: StartAfresh | None = None, *, rejected: str | None = None
    ) -> None:
        """Ends a running request: done, with a fresh start, or rejected for a reason."""
        check_end(answer, rejected)
        if rejected is not None:
            self._report(request, Answer.REJECTED, rejected)
        else:
            self._report(request, Answer.DONE if answer is None else Answer.START_AFRESH, "")

    def _report(self, request: str, answer: int, text: str) -> None:
        index = numbered(request, self._requests, "request")
        self._reports = [each for each in self._reports if each[0] != index]
        self._reports.append((index, answer, text))

    def report(self) -> tuple[Any, ...] | None:
        """Returns the calls on this reading, for the compiled loop; None: no calls."""
        report = (
            *(self._finished, self._missed, self._has_desired),
            *(self._halt, self._interrupted, self._reports),
            self._follows,
        )
        return None if report == (False, False, False, None, [], [], False) else report
