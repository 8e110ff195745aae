"""Commander: the part of o80.Frontend that commands, requests, bursts and halts."""

import contextlib
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from typing import TYPE_CHECKING, Any, Literal, Self, SupportsIndex, TypeAlias, cast, overload

import numpy as np

import o80._core as _core
from o80.base.argument_checks import whole
from o80.base.errors import (
    BackendHalted,
    Error,
    InvalidArgument,
    NotBursting,
    RequestRejected,
    TimeoutError,
)
from o80.base.signatures import explains
from o80.base.words import (
    LateWord,
    ModeWord,
    OnErrorWord,
    ProfileWord,
    RowsWord,
    StartWord,
    Status,
)
from o80.frontend.prepared_burst import PreparedBurst
from o80.frontend.reader import Reader
from o80.rows.targets import states_of, times_of

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from o80.frontend.results import Halt, Preview, RunningRequest

#: A number, a mapping from fields to numbers, or one of these for each actuator.
Tolerance: TypeAlias = float | Mapping[str, Any] | Sequence[float | Mapping[str, Any]]


@explains
class Commander(Reader):
    """The part of o80.Frontend that commands, requests, bursts and halts."""

    _on_error: OnErrorWord
    _open_plans: set[int]  # numbers of plans of chunks that were begun and not closed

    # ------------------------------------------------------------------ commands and requests

    if TYPE_CHECKING:

        def add_command(
            self,
            actuator: SupportsIndex | str | Sequence[SupportsIndex | str] | None,
            target: Any,
            *,
            duration: float | None = None,
            speed: float | None = None,
            until: int | None = None,
            iterations: int | None = None,
            fastest: bool = False,
            mode: ModeWord = "queue",
            profile: ProfileWord | None = None,
            start: StartWord = "desired",
            every: float | int | None = None,
            clip: bool = False,
        ) -> int:
            """Adds a command to the next pulse.

            actuator: its index or its name. Several, the name of a group, or None for all make one
                command for all of them: it begins when it is the next command of all of them, takes
                as many iterations as the slowest, and has one status. It needs a target for each.
            target: the state to reach, in the unit of its field. A number is its first field (or
                the state, if that is one number); otherwise a mapping, a record, or all fields in
                order. Fields that are left out keep their desired value.
            duration: time of the motion [s].
            speed: peak speed of the first number that is given [its unit/s].
            until: the iteration in which the target is reached.
            iterations: number of iterations of the motion.
            fastest: as fast as the limits of speed, acceleration and jerk allow, at rest at the
                end. Give one of these five, or none for a set-point: it goes to its target as fast
                as the limits allow (without limits: in one iteration), and gives way to the next.
            mode: "queue" (after the queued commands) or "overwrite" (instead of them).
            profile: "linear", "minimum_jerk" (None: linear, or minimum_jerk for actuators with
                acceleration limits), or, for a set-point, "as_sent": for a generator at the rate
                of the loop, whose targets are shown as they are where the limits allow.
            start: "desired" or "observed", the state to start from.
            every: for a set-point of a stream, the time to the next one [s], or as an integer the
                number of iterations. On actuators with acceleration limits the motion then takes
                twice that, or longer, so that a stream moves smoothly.
            clip: True puts numbers outside minimum and maximum on them, and counts these in
                `clipped`, instead of refusing the command.

            Every command ends at its target. If the limits make it longer than requested, it is
            completed later, with the reason "limits".

            Returns its place in the batch: `arm.pulse()[place]` is its handle.
            Raises InvalidArgument for a command that the robot cannot follow.
            """

        def add_request(self, name: str, /, **fields: Any) -> int:
            """Adds a request to the next pulse.

            It is served in order with the commands of that pulse. Every field without a default
            must be given; `o80 info` shows the defaults. Returns its place, as add_command.
            """

        def add_purge(self, actuator: SupportsIndex | str | None = None) -> int:
            """Adds a purge of one actuator, or of all, to the next pulse; returns its place."""

        @property
        def added(self) -> int:
            """Number of commands, requests and purges that were added and not pulsed."""

        @property
        def clipped(self) -> int:
            """Numbers of targets that `clip` has put inside their bounds so far."""

        def forget_added(self) -> None:
            """Drops all that was added and not pulsed."""

        def pulse(
            self,
            *,
            at: int | None = None,
            late: LateWord = "reject",
            seen: _core.Observation | _core.Seen | None = None,
        ) -> _core.Batch:
            """Sends all that was added as one batch; does not wait.

            at: the iteration in which the backend takes the batch (None: at once).
            late: if that iteration has begun already: "reject" the batch, or take it "now".
            seen: the observation by which the batch was decided, of this or another segment, or
                the `seen` of another batch. It changes no motion; the journal keeps it, and
                `Batch.decision_latency` gives the delay of the decision.

            Raises LaneFull if the lane has no room for it (nothing is sent, all stays added),
            NoLane, ReadOnly, BackendGone.
            """

        def pulse_and_wait(
            self,
            timeout: float | None = None,
            *,
            at: int | None = None,
            late: LateWord = "reject",
            seen: _core.Observation | _core.Seen | None = None,
            check: bool = True,
        ) -> _core.Observation:
            """Sends all that was added and waits until every command of it has ended.

            A bursting backend runs until then. Returns the observation of the last iteration (if
            nothing was added: the newest one).

            timeout: how long to wait [s].
            at, late, seen: as in pulse.
            check: False only waits, whatever ends the commands have.

            Raises NotCompleted if a command or request ended otherwise than completed, or the whole
            batch was rejected; overwritten by a later command of this frontend is no error. Raises
            BackendHalted if a halt ended a command or the batch, BackendGone if the backend ends
            or has ended, TimeoutError after the timeout with the `batch`, and the exceptions of
            pulse.
            """

        def purge(self, actuator: SupportsIndex | str | None = None) -> _core.Batch:
            """Drops all commands, from all frontends, of an actuator (None: of all) at once.

            Needs no pulse; added commands stay added.
            """

        def mark(self, text: str) -> _core.Batch:
            """Notes a line of text in the journal, at the iteration in which it is taken.

            Recordings list it among their marks; `o80 plot`, `view` and `echo --commands` show it.
            It moves nothing and is taken while the robot is halted, or under another's control.
            Needs no pulse. A backend that bursts inline takes it with its next burst.

            text: printable, at most 976 bytes in UTF-8. Raises InvalidArgument.
            """

    def add_trajectory(
        self,
        targets: "ArrayLike | Mapping[str, Any]",
        actuators: int | str | Sequence[int | str] | None = None,
        *,
        iterations: int | None = None,
        times: "ArrayLike | None" = None,
        speed: float | None = None,
        mode: ModeWord = "queue",
        profile: ProfileWord | RowsWord | None = None,
        start: StartWord = "desired",
        clip: bool = False,
    ) -> int:
        """Adds one command through many states, for one or several actuators of any groups.

        targets: (T, actuators), or (T,) for a single actuator. As in add_command, a number is the
            first field of a state; otherwise a structured array, or a mapping from fields, groups,
            actuators, or paths such as "joint1.position" to arrays. Fields that are left out keep
            their desired value.
        actuators: indices or names, also of groups (None: all).
        iterations: number of iterations for each row (default: 1).
        times: when each row is reached, since the start [s]: (T,), each in an iteration of its own.
        speed: peak speed to each row, as in add_command.
        profile: "smooth" (default, not with speed): a curve through the rows, as through samples
            of a smooth motion, at rest at the last one; "monotone": one that stays between its
            rows; "linear" (default with speed): straight lines;
            "hold": each row from the iteration after the one before it; "minimum_jerk": at rest
            at each row.
        mode, start, clip: as in add_command.

        Several actuators reach each row together, as in add_command. If InvalidArgument is raised,
        nothing is added. Returns its place, as add_command.
        """
        if times is not None and (iterations is not None or speed is not None):
            raise InvalidArgument(
                "a trajectory has one pace: give one of iterations, times and speed"
            )
        if times is None and speed is None and iterations is None:
            iterations = 1
        chosen, _ = self._chosen(actuators)
        states, rows, masks = states_of(targets, chosen, self._layout)
        ends = b"" if times is None else times_of(times)
        options = _core.CommandOptions(
            speed=speed,
            iterations=iterations,
            mode=mode,
            profile=profile,
            start=start,
            of_rows=True,
        )
        return self._add_trajectories(chosen, rows, states, masks, ends, options, clip)

    def request(
        self,
        name: str,
        /,
        *,
        timeout: float | None = None,
        seen: _core.Observation | _core.Seen | None = None,
        **fields: Any,
    ) -> None:
        """Sends a request to the driver at once and waits for its end.

        name: name of the request; `requests` lists them.
        timeout: how long to wait for the end of the request [s].
        seen: as in pulse.
        fields: fields of the request; those with a default may be left out.

        No pulse is needed; commands that were not pulsed stay added. A bursting backend runs until
        the request has ended. Raises RequestRejected with the driver's text, BackendHalted if a
        halt ended the request, BackendGone, and TimeoutError, whose `batch` can be waited for
        again: the request continues. `add_request` makes a request part of a pulse without waiting.
        """
        batch = self._send_request(name, fields, seen)
        self._wait_for_answer(name, batch, timeout)

    def _wait_for_answer(self, name: str, batch: _core.Batch, timeout: float | None) -> None:
        try:
            self._wait_until_ended(batch, timeout)
        except TimeoutError as error:
            handle = batch.handles[0]
            if handle.status != Status.ACTIVE:
                raise
            progress = f" ({handle.progress})" if handle.progress else ""
            raise TimeoutError(
                f"'{name}' of '{self.segment}' still runs{progress} and continues: pass a "
                f"longer timeout, or wait for the `batch` of this error",
                batch,
            ) from error
        handle = batch.handles[0]
        if handle.status == Status.HALTED:
            raise BackendHalted(f"'{name}' of '{self.segment}' was ended: {handle.text}")
        if handle.status != Status.COMPLETED:
            raise RequestRejected(
                f"request '{name}' to '{self.segment}' was not completed: {handle.text}"
            )

    @property
    def running_requests(self) -> "list[RunningRequest]":
        """Requests that take time and have not ended, oldest first, of all frontends."""
        from o80.frontend.results import RunningRequest

        return [RunningRequest(*fields) for fields in self._running_requests]

    # ------------------------------------------------------------------ what a command would do

    def preview(
        self,
        actuator: SupportsIndex | str | Sequence[SupportsIndex | str] | None,
        target: Any,
        *,
        duration: float | None = None,
        speed: float | None = None,
        until: int | None = None,
        iterations: int | None = None,
        fastest: bool = False,
        profile: ProfileWord | None = None,
        start: StartWord = "desired",
        every: float | int | None = None,
        initial: Any = None,
    ) -> "Preview":
        """Computes the effect of `add_command` with the same arguments after the newest row.

        The code of the loop computes it here, so the robot's motion is the same, bit for bit. Sends
        nothing, adds nothing, works read-only.

        actuator, target, duration, speed, until, iterations, fastest, profile, start, every: as in
            add_command.
        initial: the state from which it begins at rest, in the form of `target`. Fields that are
            left out, and all fields with None, begin as in the newest row.

        With None, fields of type float64 with acceleration limits begin with the velocity and
        acceleration of the last three rows, other fields at rest. Commands that run or wait do not
        count. Actuators without a target are shown as if they had no command.

        Raises InvalidArgument like add_command, for a past `until`, for a motion of more than a
        million iterations, for states that the driver interpolates in C++ (`blend`), and for
        fields whose integral has bounds: their motion depends on future observations.
        """
        options = _core.CommandOptions(
            duration=duration,
            speed=speed,
            until=until,
            iterations=iterations,
            fastest=fastest,
            profile=profile,
            start=start,
            every=every,
            period=self.schema["period"],
        )
        late, text, desired = self._preview(actuator, target, initial, options)
        rows = np.frombuffer(desired, np.dtype([("desired", self._layout.states)]))
        from o80.frontend.results import Preview

        return Preview(len(rows), late, text, self._layout.many(rows, "desired"))

    # ------------------------------------------------------------------ motions to the end

    def move_to(
        self,
        actuators: SupportsIndex | str | Sequence[SupportsIndex | str] | None,
        targets: Any,
        *,
        tolerance: Tolerance,
        timeout: float | None = None,
        duration: float | None = None,
        speed: float | None = None,
        until: int | None = None,
        iterations: int | None = None,
        fastest: bool = False,
        mode: ModeWord = "queue",
        profile: ProfileWord | None = None,
        start: StartWord = "desired",
    ) -> _core.Observation:
        """Sends a command at once and waits until the robot is observed at its targets.

        actuators, targets, duration, speed, until, iterations, fastest, mode, profile, start:
            as in add_command.
        tolerance: largest distance between observed and target, in the unit of the field: a
            number for all fields that have a target, a mapping from fields to numbers (other
            fields are not judged), or a sequence with one of these for each actuator.
            Booleans and enumerations must be equal.
        timeout: how long to wait [s].

        It first waits until the command has ended. No pulse is needed; commands that were not
        pulsed stay added. A bursting backend runs until the robot is at its targets; `timeout` is
        then time of the robot (iterations x period), so that a script always ends alike.

        Returns the observation in which the robot was within the tolerance. Raises NotReached, with
        the position, after the timeout; commands that have not ended continue. Raises NotCompleted
        if the command ended otherwise than completed, BackendHalted, BackendGone, InvalidArgument,
        and the exceptions of pulse.
        """
        options = _core.CommandOptions(
            duration=duration,
            speed=speed,
            until=until,
            iterations=iterations,
            fastest=fastest,
            mode=mode,
            profile=profile,
            start=start,
        )
        move = self._start_move(actuators, targets, tolerance, timeout, options)
        return self._wait_for_move(move, timeout)

    # ------------------------------------------------------------------ bursts

    @overload
    def burst(
        self,
        iterations: int = 1,
        *,
        timeout: float | None = None,
        wait: Literal[True] = True,
        at: int | None = None,
        late: LateWord = "reject",
        seen: _core.Observation | _core.Seen | None = None,
    ) -> _core.Observation: ...
    @overload
    def burst(
        self,
        iterations: int = 1,
        *,
        timeout: float | None = None,
        wait: Literal[False],
        at: int | None = None,
        late: LateWord = "reject",
        seen: _core.Observation | _core.Seen | None = None,
    ) -> _core.Burst: ...
    def burst(
        self,
        iterations: int = 1,
        *,
        timeout: float | None = None,
        wait: bool = True,
        at: int | None = None,
        late: LateWord = "reject",
        seen: _core.Observation | _core.Seen | None = None,
    ) -> _core.Observation | _core.Burst:
        """Sends all that was added and runs exactly this number of iterations.

        at: the iteration in which the backend takes the batch, of this burst or a later one (None:
            the first iteration of this burst).
        late: if that iteration has begun already: "reject" the batch, which then does not burst, or
            take it "now".
        seen: as in pulse.

        Returns the observation of the last iteration; with `wait=False` a Burst, to wait for or to
        cancel. A call that ends without its last row (timeout, Ctrl-C) cancels the rest of its
        burst after the current iteration. So do the end of this frontend and its death.
        `prepared_burst` is faster for bursts that are repeated.

        Raises NotBursting, TimeoutError after `timeout` [s], BackendGone, LaneFull,
        InvalidArgument.
        """
        if wait:
            return self._burst(iterations, timeout, at, late, seen)
        return self._start_burst(iterations, at, late, seen)

    def prepared_burst(
        self,
        iterations: int = 1,
        actuators: int | str | Sequence[int | str] | None = None,
        *,
        steps: int = 1,
        each: int = 1,
        mode: ModeWord = "queue",
        profile: ProfileWord = "linear",
        start: StartWord = "desired",
    ) -> PreparedBurst:
        """Prepares a repeatable burst, which sends targets and returns all rows.

        iterations: number of iterations of each burst.
        actuators: indices or names of the actuators that get targets (None: all).
        steps: number of targets of each actuator in a burst.
        each: 1: each target is a set-point for its iteration, the last one stays in force; more:
            rows of a trajectory, one every so many iterations.
        mode, profile, start: as in add_command.

        Raises NotBursting for a backend in real time, InvalidArgument.
        """
        self._check_usable()
        if not self.bursting:
            raise NotBursting(
                f"'{self.segment}' runs in real time and cannot be burst: start it with bursting"
            )
        chosen, _ = self._chosen(actuators)
        options = iterations, steps, each, mode, profile, start, 0
        return PreparedBurst(self, self._layout, (), chosen, *options)

    # ------------------------------------------------------------------ control and halts

    def control(self, timeout: float | None = 5.0) -> AbstractContextManager[Self]:
        """Takes exclusive control in a `with` block: batches of other frontends are rejected.

        Blocks of one frontend may nest or overlap: control ends with the last of them. An interrupt
        (Ctrl-C) at any moment releases control too.
        Raises ControlTaken, naming the holder, if another frontend has it.
        """
        return cast(AbstractContextManager[Self], _core.Control(self, timeout))

    if TYPE_CHECKING:

        def halt(self, reason: str = "") -> int:
            """Halts the backend: commands end as halted, actuators brake within their limits.

            Nothing moves again until `resume`. In force from the first iteration begun after it;
            needs no control. Returns the number of the halt. Raises ReadOnly, BackendGone.
            """

        def keep_alive(self) -> None:
            """Gives the backend's watchdog a sign of life.

            A pulse and a wait for a batch of this frontend do so too; reading does not.
            """

    @property
    def halted(self) -> "Halt | None":
        """The halt in force or requested (iteration None: not in force yet); None: no halt."""
        fields = self._halted
        if fields is None:
            return None
        from o80.frontend.results import halt_of

        return halt_of(fields)

    def resume(
        self,
        number: int | None = None,
        *,
        timeout: float | None = 5.0,
        accept_reading: bool = False,
    ) -> bool:
        """Ends a halt: the robot makes a fresh start at its present position, with empty queues.

        number: number of the halt (None: the one in force now). A halt that came after it stays.
        timeout: how long to wait until the halt is in force, the robot is at rest, and the backend
            has answered [s].
        accept_reading: continue from the read position, even if the robot cannot have moved there
            since the halt.

        Needs a lane, but no control. In bursting mode it does not wait until the robot is at rest:
        burst until it is.

        Raises BackendHalted if the backend refuses: another halt followed, the robot refuses, it
        cannot be at the read position, or, in bursting mode, it still brakes. Raises
        TimeoutError, NoLane, BackendGone.
        Returns True if the call ended a halt, False if there was none.
        """
        if number is None:
            halt = self.halted
            if halt is None:
                return False
            number = halt.number
        return self._resume(whole(number, "the number of a halt", 1), timeout, accept_reading)

    def _purge_on_error(self) -> None:
        """Drops the commands of this frontend after an error, unless `on_error` is "continue"."""
        if self._on_error == "purge":
            with contextlib.suppress(Error):
                self._purge_own()
