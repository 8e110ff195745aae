"""Backends whose loop runs inside a Python program."""

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

import o80._core as _core
from o80.base import argument_checks, lifecycle
from o80.base.argument_checks import nothing
from o80.base.errors import InvalidArgument, RequestRejected, exception_text
from o80.base.loop_options import loop_texts, names_of
from o80.base.words import IdleWord, StaleWord
from o80.drivers.description import Described, Limit, SchemaWriter, numbered
from o80.rows.enumerations import numbers_of
from o80.rows.layout import Layout, request_fields
from o80.rows.record import Record


@dataclass(frozen=True)
class StartAfresh:
    """Returned by the handler of a request after a jump of the robot, with its new reading.

    The backend makes a fresh start: it drops all queues and publishes an extra row with this
    reading and desired = observed (or `desired`). Iterations continue to count.
    A driver (`o80.drivers`) returns StartAfresh(), and its next reading has the numbers.
    """

    observed: Any = None
    extended: Any = None
    desired: Any = None


@dataclass(frozen=True)
class Running:
    """Returned by the handler of a request that runs until `Backend.end_request`.

    progress: text for frontends while it runs; `Backend.progress` changes it.
    """

    progress: str = ""

    def __post_init__(self) -> None:
        argument_checks.text(self.progress, "progress of o80.Running")


def check_end(answer: StartAfresh | None, rejected: str | None) -> None:
    """Raises InvalidArgument for a wrong answer or text, or if there is an answer and a text."""
    if answer is not None and not isinstance(answer, StartAfresh):
        raise InvalidArgument(
            f"answer must be None or o80.StartAfresh(...), got {answer!r}; to reject the "
            f"request, give rejected='why'"
        )
    if rejected is not None:
        argument_checks.text(rejected, "rejected")
        if answer is not None:
            raise InvalidArgument("give either answer or rejected, not both")


KEEPS = ", or raise o80.RequestRejected to keep the halt"


class Answer:
    """Results of a request, with the numbers of the compiled loop."""

    DONE = 0
    REJECTED = 1
    START_AFRESH = 2
    FAILED = 3
    RUNNING = 4

    @staticmethod
    def of(handler: Callable[[], Any], what: str) -> tuple[int, str]:
        """Calls a handler and converts its answer to number and text.

        Raises InvalidArgument for other answers.
        """
        try:
            answer = handler()
        except RequestRejected as why:
            return Answer.REJECTED, str(why) or f"{what} gave no reason"
        if answer is None:
            return Answer.DONE, ""
        if isinstance(answer, Running):
            return Answer.RUNNING, answer.progress
        if isinstance(answer, StartAfresh):
            return Answer.START_AFRESH, ""
        raise InvalidArgument(
            f"{what} must return None, o80.StartAfresh(...) or o80.Running(...), or raise "
            f"o80.RequestRejected; got {answer!r}"
        )


Handler = Callable[[Record], StartAfresh | Running | None]


class Backend(lifecycle.Managed):
    """A backend whose loop runs in a Python program.

        with o80.Backend("arm", ["shoulder", "elbow"]) as backend:
            backend.publish(read())                    # row 0
            while (desired := backend.step()) is not None:
                write(desired)
                backend.publish(read())

    segment: the name that frontends attach to.
    actuators: their names; or how many; or a mapping from groups to a dtype (one actuator),
        (dtype, how many) or (dtype, names).
    dtype: of the state of an actuator, unless the groups say it: a NumPy dtype, float, int, bool,
        an IntEnum, or a mapping from field names to these.
    extended: dtype (or mapping) of further sensor values.
    requests: names of the requests it serves, each with the dtype of its fields, or None; see `on`.
            The fields have no defaults: the sender must give all of them.
    limits: of actuators: o80.Limits, or (minimum, maximum, speed, ...), of the first number of the
        state, or a mapping from fields to these; None is no limit.
    rests_at: of actuators: a mapping from fields to the values that they approach without a command
        (a velocity: 0).
    when_idle: "hold" or "follow", for all actuators or a mapping from each.
    units: of fields, by their name or by "group.field".
    frequency: iterations a second [1/s] (None: 1000). The program keeps the pace itself; with
        `bursting` it is the frequency of simulated time.
    bursting: `step` waits until a frontend requests iterations.
    robot: name of the robot (None: that of the segment).
    history: observations kept (None: as many as 16 MiB hold, 100000 at most).
    while_halted: requests that are served during a halt too, because they move nothing.
    lanes, lane_blocks, journal, permission, stale, silence, resume: as for
        `o80.robots.Robot.start`.
    model: model for `o80 view`: the path of an MJCF file, or its text.
    joints: joints of the model, each with its source: an actuator, whose state must begin with a
        float64, or (field, index) of an extended field of float64.
    max_overruns: halt when so many rows within a second come half a period late, or later.
    accept_reading: begin at the read position, even if the robot cannot have reached it.

    An exception that leaves the `with` block ends the backend as failed: frontends raise its text.
    One thread uses it; any thread may call `stop` and `close`. Raises SegmentTaken if the name is
    taken, SegmentError if there is no memory, InvalidArgument for a wrong description.
    """

    def __init__(
        self,
        segment: str,
        actuators: Any = (),
        dtype: Described = float,
        *,
        extended: Described | None = None,
        requests: Mapping[str, Described | None] | None = None,
        limits: Mapping[Any, Limit | Mapping[str, Limit]] | None = None,
        rests_at: Mapping[Any, Mapping[str, float]] | None = None,
        when_idle: IdleWord | Mapping[Any, IdleWord] = "hold",
        units: Mapping[str, str] | None = None,
        frequency: float | None = None,
        bursting: bool = False,
        robot: str | None = None,
        history: int | None = None,
        lanes: int | None = None,
        lane_blocks: int | None = None,
        journal: float | None = None,
        permission: int | None = None,
        stale: StaleWord | None = None,
        silence: int | None = None,
        max_overruns: int | None = None,
        resume: bool = False,
        accept_reading: bool = False,
        while_halted: Sequence[str] = (),
        model: str | os.PathLike[str] | None = None,
        joints: Mapping[str, int | str | tuple[str, int]] | None = None,
    ) -> None:
        given = locals()
        loop = loop_texts(given, names_of("backend"))
        writer = SchemaWriter.of(robot or segment, given.get)
        native = _core.Backend(writer.builder, segment, loop)
        self._layout = Layout(native.description)
        self._segment = segment
        self._handlers: dict[str, Handler] = {}
        self._fresh_start: StartAfresh | None = None  # answer of a request that has ended
        self._halt_handlers: dict[str, Callable[[], None]] = {}
        self._observed = self._layout.labelled_states(native.observed)
        self._fresh_desired = self._layout.labelled_states(native.fresh_desired)
        self._extended = self._layout.labelled_extras(native.extended)
        native.serve_with = Server(self)
        self._native = native
        lifecycle.close_later(self)

    # ------------------------------------------------------------------ publish and step

    def publish(self, observed: Any = None, extended: Any = None) -> None:
        """Publishes the reading of the current iteration as a row; the first one is row 0.

        observed: an array (actuators,), or a mapping from groups to states.
        extended: a mapping from fields to values, or a record. None, and fields that the mapping
            leaves out, keep the values of the row before.

        Raises InvalidArgument if row 0 has a number that is NaN, infinite or, in real time, too far
        outside its bounds: publish it again when the reading is right. In real time also if the
        robot cannot have moved from row 0 to the next reading: one of the two is wrong, and the
        backend ends.
        """
        self._native.check()
        if observed is not None:
            fill(self._observed, observed, "observed")
        if extended is not None:
            fill(self._extended, extended, "extended")
        self._native.publish()

    def step(self, timeout: float | None = None) -> Any:
        """Begins an iteration and returns its desired states, a new array or record; None after
        `stop`.

        In bursting mode it waits until a frontend requests iterations, and raises TimeoutError
        after `timeout` [s]. It calls the handlers of requests. If a handler raises (other than
        RequestRejected) or returns a StartAfresh with NaN or infinite numbers, `step` raises that
        exception or InvalidArgument: then close the backend.
        """
        if self._fresh_start is not None:
            fresh, self._fresh_start = self._fresh_start, None
            read_afresh(fresh, self._observed, self._extended, self._fresh_desired)
        if not self._native.step(timeout):
            return None
        return self._layout.of_states(self._layout.states_in(self._native.desired()))

    # ------------------------------------------------------------------ requests and halts

    def on(self, request: str, handler: Handler) -> None:
        """Sets the handler of a request, which is called between two iterations with its fields.

        The handler returns None, StartAfresh if the robot jumped, or Running if the request takes
        time. It raises RequestRejected to reject the request; the sender reads the text.
        """
        index = self._index_of(request)
        self._native.check()
        self._handlers[self._layout.schema["requests"][index]["name"]] = handler

    def running(self, request: str) -> bool:
        """True if a request was answered with Running and has not ended.

        A halt ends it, unless it is in `while_halted`: the program must then stop the motion.
        """
        return self._native.runs(self._index_of(request))

    def progress(self, request: str, text: str) -> None:
        """Sets the text that frontends get while a request runs: at most 247 bytes."""
        self._native.show_progress(self._index_of(request), argument_checks.text(text, "progress"))

    def end_request(
        self, request: str, answer: StartAfresh | None = None, *, rejected: str | None = None
    ) -> None:
        """Ends a request that was answered with Running.

        answer: None, or StartAfresh if the robot jumped: the next step makes a fresh start, and the
            request ends with the row of this fresh start.
        rejected: the reason of its failure, for the sender.

        Without a jump it ends with the next published row. No effect if it does not run any more.
        """
        index = self._index_of(request)
        check_end(answer, rejected)
        if not self._native.runs(index):
            return
        self._fresh_start = answer or self._fresh_start
        self._native.end_request(index, answer is not None, rejected)

    def _index_of(self, request: str) -> int:
        return numbered(
            request, [row["name"] for row in self._layout.schema["requests"]], "request"
        )

    def on_halt(self, handler: Callable[[], None]) -> None:
        """Sets a function to call when a halt begins: commands have ended, desired states brake."""
        self._native.check()
        self._halt_handlers["halt"] = handler

    def on_resume(self, handler: Callable[[], None]) -> None:
        """Sets a function to call before a halt is cleared; RequestRejected in it keeps the halt.

        Desired states then continue from the last observed states.
        """
        self._native.check()
        self._halt_handlers["resume"] = handler

    def halt(self, reason: str = "") -> None:
        """Halts: commands end, actuators brake, nothing moves until a frontend resumes.

        The halt is in force from the next `step` on. May be called from any thread. A call with the
        same reason belongs to the same halt; another reason is another halt.
        """
        self._native.halt(reason)
        argument_checks.text(reason, "the reason of a halt")

    def interrupt(self, actuator: int | str) -> None:
        """Ends the commands of an actuator as interrupted, in the current iteration."""
        names = [row["name"] for row in self._layout.schema["actuators"]]
        self._native.interrupt(numbered(actuator, names, "actuator"))

    def stop(self) -> None:
        """Makes `step` return None. May be called from any thread."""
        self._native.ask_to_stop()

    def close(self, failure: str | None = None) -> None:
        """Ends the backend, as failed if `failure` is given: frontends raise it with this text.

        A `step` that waits in another thread raises Closed.
        """
        text = self._native.failure if failure is None else failure
        self._native.end(bool(text), text)
        self._handlers.clear()
        self._halt_handlers.clear()

    def _close_at_exit(self) -> None:
        self.close()

    def __reduce__(self) -> tuple[Any, ...]:
        raise TypeError(
            f"a backend cannot be pickled, it belongs to this process: send its segment's name, "
            f"and open o80.Frontend({self._segment!r}) there"
        )

    @property
    def active(self) -> NDArray[np.bool_]:
        """True where a command or braking gives the desired state: bool (actuators,)."""
        return self._layout.mask_in(np.frombuffer(self._native.active(), np.uint8))

    @property
    def iteration(self) -> int:
        """The current iteration."""
        return self._native.iteration

    @property
    def time(self) -> int:
        """Time of the current iteration [ns]: monotonic clock, or simulated in bursting mode."""
        return self._native.time

    @property
    def segment(self) -> str:
        """The name of the segment, to which frontends attach."""
        return self._segment

    @property
    def schema(self) -> dict[str, Any]:
        """The description of the robot for frontends."""
        return self._layout.schema

    def _leave(self, error: BaseException | None) -> None:
        self.close(exception_text(error) if isinstance(error, Exception) else None)

    def __repr__(self) -> str:
        return f"<o80.Backend of '{self._segment}'{', closed' if self._native.closed else ''}>"


class Server:
    """Calls the handlers of requests. Holds references to the backend's buffers only."""

    def __init__(self, backend: Backend) -> None:
        self._handlers = backend._handlers
        self._halt_handlers = backend._halt_handlers
        self._rows = backend._layout.schema["requests"]
        self._observed = backend._observed
        self._extended = backend._extended
        self._desired = backend._fresh_desired

    def __call__(self, index: int, payload: bytes) -> tuple[int, str]:
        row = self._rows[index]
        handler = self._handlers.get(row["name"])
        if handler is None:
            return Answer.REJECTED, (
                f"request '{row['name']}' has no handler: the backend's program must call "
                f"Backend.on({row['name']!r}, handler)"
            )

        def answer() -> StartAfresh | Running | None:
            given = handler(request_fields(row["type"], bytearray(payload)))
            if isinstance(given, StartAfresh):
                read_afresh(given, self._observed, self._extended, self._desired)
            return given

        return Answer.of(answer, f"the handler of '{row['name']}'")

    def halt(self) -> tuple[int, str]:
        """Calls the handler of on_halt, when a halt begins."""
        if handler := self._halt_handlers.get("halt"):
            nothing(handler(), "the handler of on_halt")
        return Answer.DONE, ""

    def resume(self) -> tuple[int, str]:
        """Calls the handler of on_resume."""
        self._desired[...] = self._observed
        handler = self._halt_handlers.get("resume")
        if handler is None:
            return Answer.DONE, ""
        what = "the handler of on_resume"
        return Answer.of(lambda: nothing(handler(), what, KEEPS), what)


def read_afresh(
    answer: StartAfresh,
    observed: NDArray[Any],
    extended: NDArray[Any],
    desired: NDArray[Any],
) -> None:
    """Writes the reading of a fresh start into the buffers of a row."""
    if answer.observed is None:
        raise InvalidArgument("StartAfresh needs the new reading: o80.StartAfresh(observed, ...)")
    fill(observed, answer.observed, "observed")
    if answer.extended is not None:
        fill(extended, answer.extended, "extended")
    desired[...] = observed
    if answer.desired is not None:
        fill(desired, answer.desired, "desired")


def fill(block: NDArray[Any], values: Any, what: str) -> None:
    """Writes states or sensor values into a buffer of a row."""
    names = block.dtype.names
    if isinstance(values, Record):
        block[...] = np.asarray(values)
    elif isinstance(values, Mapping):
        for name, value in values.items():
            if names is None or name not in names:
                instead = _core.names_instead(str(name), list(names or ()))
                raise InvalidArgument(f"{what} has no field {name!r}{instead}")
            if isinstance(value, Mapping):  # NumPy would treat it as one value, which is true
                fill(block[name], value, f"{what}.{name}")
                continue
            try:
                block[name] = value
            except (TypeError, ValueError) as error:
                raise InvalidArgument(f"{what}: field {name!r}: {error}") from error
    else:
        values = numbers_of(getattr(block, "_labels", None), values)
        try:
            array = np.asarray(values, block.dtype)
        except (TypeError, ValueError) as error:
            raise InvalidArgument(f"{what} cannot be read as {block.dtype}: {error}") from error
        if array.shape != block.shape:
            raise InvalidArgument(f"{what} must have the shape {block.shape}, got {array.shape}")
        block[...] = array
