"""Connects one driver object to the compiled loop."""

import inspect
import traceback
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

import o80._core as _core
from o80.base.argument_checks import nothing
from o80.base.descriptors import above_standard
from o80.base.errors import Error, InvalidArgument, exception_text
from o80.drivers.backend import KEEPS, Answer
from o80.drivers.description import SchemaWriter
from o80.drivers.reading import Desired, Differences, DriverFaultError, Reading
from o80.rows.layout import Layout, dtype_of_type, request_fields

NANOSECOND = 1e-9


def fault_of(error: BaseException) -> str:
    """Returns the text that frontends get for an exception of a driver."""
    if isinstance(error, (DriverFaultError, Error)):
        return str(error)
    text = exception_text(error)
    frames = traceback.extract_tb(error.__traceback__)
    if frames:
        where = frames[-1]
        text += f" ({where.filename}:{where.lineno}, in {where.name})"
    return text


class Adapter:
    """Holds the memory through which rows pass, and calls the methods of the driver.

    The compiled loop fills `desired_block` and `active_words` before `write`, fills
    `observed_block` and `extended_block` before `read`, and reads these after it; `fresh_block` has
    the desired states of a fresh start.
    """

    def __init__(self, driver: Any, name: str) -> None:
        self._driver = driver
        self._name = name
        self.period = 0

    def describe(self, requested: int) -> _core.SchemaBuilder:
        """Describes the driver as a schema. requested: period from the user [ns]; 0: none."""
        self.period = self._period(requested)
        writer = SchemaWriter.of(self._name, self._given)
        if not isinstance(simulated := self._given("simulated", False), bool):
            raise InvalidArgument(f"simulated must be True or False, got {simulated!r}")
        writer.builder.simulated(simulated)
        if (gap := self._given("gap")) is not None:
            if not isinstance(gap, (int, float)) or not 1e-6 <= gap <= 3600:
                raise InvalidArgument(f"gap must be from 0.000001 to 3600 s, got {gap!r}")
            writer.builder.gap(round(gap / NANOSECOND))
        self._make_blocks(Layout(writer.builder.description()))
        return writer.builder

    def give_differences(self, differences: Differences) -> None:
        """Stores the differences for `Desired.rate`; call it after describe()."""
        self._desired.differences = differences

    def _given(self, name: str, default: Any = None) -> Any:
        return getattr(self._driver, name, default)

    def _period(self, requested: int) -> int:
        own = self._given("frequency")
        if own is None:
            return requested
        if not isinstance(own, (int, float)) or not 0 < own <= 1e9:
            raise InvalidArgument(f"frequency must be a positive number, got {own!r}")
        period = round(1.0 / own / NANOSECOND)
        if requested not in (0, period):
            raise InvalidArgument(
                f"the driver runs at {own:g} Hz, but {1 / (requested * NANOSECOND):g} Hz was "
                f"requested: leave the frequency out, or set it to {own:g}"
            )
        return period

    def _make_blocks(self, layout: Layout) -> None:
        """Allocates the states and the sensor values of a row."""
        schema = layout.schema
        actuators = [row["name"] for row in schema["actuators"]]
        self._requests: list[Mapping[str, Any]] = schema["requests"]
        names = [row["name"] for row in self._requests]
        for name in names:
            if not callable(getattr(self._driver, f"on_{name}", None)):
                raise InvalidArgument(
                    f"{type(self._driver).__name__} lists the request '{name}': give it the method "
                    f"on_{name}(self, fields)"
                )
        self.payload_sizes = [dtype_of_type(row["type"]).itemsize for row in self._requests]

        size = layout.states.itemsize
        self.desired_block = np.zeros(size, np.uint8)
        self.observed_block = np.zeros(size, np.uint8)
        self.fresh_block = np.zeros(size, np.uint8)
        self.extended_block = np.zeros(layout.extras.itemsize, np.uint8)
        extended = layout.labelled_extras(self.extended_block)
        observed = layout.labelled_states(self.observed_block)
        fresh = layout.labelled_states(self.fresh_block)
        self.active_words = np.zeros(8 * ((len(actuators) + 63) // 64), np.uint8)
        desired = layout.states_in(self.desired_block)
        self._desired = Desired(layout, desired, self.active_words)
        self._reading = Reading(observed, extended, fresh, actuators, names)

    # ------------------------------------------------------------------ verbs

    @above_standard()
    def start(self) -> None:
        if verb := self._given("start"):
            nothing(verb(), "start()")

    def wait(self, due: int) -> None:
        nothing(self._driver.wait(due), "wait()")

    def write(self, iteration: int, time: int, period: int) -> None:
        if verb := self._given("write"):
            desired = self._desired
            desired.iteration, desired.time = iteration, time
            desired.period = period * NANOSECOND
            nothing(verb(desired), "write()")

    def read(
        self, iteration: int, time: int, fresh: bool, runs: Sequence[bool]
    ) -> tuple[Any, ...] | None:
        self._reading.begin(iteration, time, fresh, runs)
        nothing(self._driver.read(self._reading), "read()")
        return self._reading.report()

    def request(self, index: int, payload: bytes) -> tuple[int, str]:
        row = self._requests[index]
        fields = request_fields(row["type"], bytearray(payload))
        handler = getattr(self._driver, f"on_{row['name']}")
        return Answer.of(lambda: handler(fields), f"on_{row['name']}")

    def halt(self) -> None:
        nothing(self._driver.halt(), "halt()")

    def resume(self) -> tuple[int, str]:
        return Answer.of(lambda: nothing(self._driver.resume(), "resume()", KEEPS), "resume()")

    def stop(self) -> None:
        if verb := self._given("stop"):
            try:
                nothing(verb(), "stop()")
            except Exception:
                traceback.print_exc()


def check_verbs(driver: type[Any]) -> None:
    """Raises InvalidArgument if a method is missing or takes other arguments."""
    given = {"write": ["desired"], "read": ["reading"], "wait": ["due"]}
    if not callable(getattr(driver, "read", None)):
        raise InvalidArgument(f"{driver.__name__} is not a driver: give it read(self, reading)")
    for name in ("start", "write", "read", "wait", "halt", "resume", "stop"):
        verb, arguments = getattr(driver, name, None), given.get(name, [])
        if verb is None:
            continue
        call = f"{name}({', '.join(('self', *arguments))})"
        try:
            inspect.signature(verb).bind(None, *arguments)
        except (TypeError, ValueError):
            raise InvalidArgument(f"{driver.__name__}.{name} must be {call}") from None
