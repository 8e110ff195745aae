"""How a frontend adds commands, requests and purges to a batch, and sends it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, SupportsIndex

import numpy as np

import o80._core as _core
from o80.base.errors import BackendHalted, InvalidArgument, RequestRejected, TimeoutError
from o80.base.words import Status
from o80.frontend.observing import Observing
from o80.rows.targets import states_of, times_of

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from o80.base.words import LateWord, ModeWord, ProfileWord, StartWord
    from o80.frontend.running_request import RunningRequest


class Commanding(Observing):
    """The part of o80.Frontend that commands."""

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
        ) -> int:
            """Adds a command to the next pulse.

            actuator: its index or its name. Several, or None for all, make one command for all of
                them: it begins when it is the next command of all of them, takes as many iterations
                as the slowest, and has one status. It needs a target for each.
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

            Every command ends at its target. If the limits make it longer than asked, it is
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

        def forget_added(self) -> None:
            """Drops all that was added and not pulsed."""

        def pulse(self, *, at: int | None = None, late: LateWord = "reject") -> _core.Batch:
            """Sends all that was added as one batch; does not wait.

            at: the iteration in which the backend takes the batch (None: at once).
            late: if that iteration has begun already: "reject" the batch, or take it "now".

            Raises LaneFull if the lane has no room for it (nothing is sent, all stays added),
            NoLane, ReadOnly, BackendGone.
            """

        def pulse_and_wait(
            self,
            timeout: float | None = None,
            *,
            at: int | None = None,
            late: LateWord = "reject",
            check: bool = True,
        ) -> _core.Observation:
            """Sends all that was added and waits until every command of it has ended.

            A bursting backend runs until then. Returns the observation of the last iteration (if
            nothing was added: the newest one).

            timeout: how long to wait [s].
            at, late: as in pulse.
            check: False only waits, whatever ends the commands have.

            Raises NotCompleted if a command or request ended otherwise than completed, or the whole
            batch was rejected; overwritten by a later command of this frontend is no error. Raises
            BackendHalted if a halt ended a command or the batch, BackendGone if the backend ends
            or has ended, TimeoutError after the timeout with the `batch`, and the exceptions of
            pulse.
            """

        def purge(self, actuator: SupportsIndex | str | None = None) -> _core.Batch:
            """Drops all commands of an actuator (None: of all) at once, also those of others.

            Needs no pulse; what was added and not pulsed stays added.
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
        targets: ArrayLike | Mapping[str, ArrayLike],
        actuators: int | str | Sequence[int | str] | None = None,
        *,
        iterations: int | None = None,
        times: ArrayLike | None = None,
        speed: float | None = None,
        mode: ModeWord = "queue",
        profile: ProfileWord = "linear",
        start: StartWord = "desired",
    ) -> int:
        """Adds one command through many states, for one or several actuators.

        targets: (T, actuators), or (T,) for a single actuator. As in add_command, a number is the
            first field of a state; otherwise a structured array, or a mapping from fields to
            arrays. Fields that are left out keep their desired value.
        actuators: indices or names (None: all).
        iterations: number of iterations for each row (default: 1).
        times: when each row is reached, since the start [s]: (T,), not decreasing.
        speed: peak speed to each row, as in add_command.
        mode, profile, start: as in add_command.

        Several actuators reach each row together, as in add_command. If InvalidArgument is raised,
        nothing is added. Returns its place, as add_command.
        """
        if times is not None and (iterations is not None or speed is not None):
            raise InvalidArgument(
                "a trajectory has one pace: give one of iterations, times and speed"
            )
        if times is None and speed is None and iterations is None:
            iterations = 1
        chosen, single = self._chosen(actuators)
        states, rows, mask = states_of(targets, chosen, single, self._layout)
        return self._add_trajectories(
            chosen,
            rows,
            states,
            mask,
            None if times is None else times_of(times),
            speed,
            iterations,
            mode,
            profile,
            start,
        )

    def _chosen(self, actuators: int | str | Sequence[int | str] | None) -> tuple[list[int], bool]:
        """Indices of the actuators; True if a single one was named without a list."""
        if actuators is None:
            return list(range(len(self.actuators))), False
        if isinstance(actuators, (int, str, np.integer)):
            return [self._index(actuators)], True
        return [self._index(actuator) for actuator in actuators], False

    def request(self, name: str, /, *, timeout: float | None = None, **fields: Any) -> None:
        """Sends a request to the driver at once and waits for its answer.

        name: name of the request; `requests` lists them.
        timeout: how long to wait for the end of the request [s].
        fields: fields of the request; those with a default may be left out.

        It needs no pulse; what was added and not pulsed stays added. A bursting backend runs until
        the request has ended. Raises RequestRejected with the driver's text, BackendHalted if a
        halt ended it, BackendGone, and TimeoutError, whose `batch` can be waited for again: the
        request continues. `add_request` makes it a part of a pulse and does not wait.
        """
        batch = self._send_request(name, fields)
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
    def running_requests(self) -> list[RunningRequest]:
        """The requests that take time and have not ended, oldest first, whoever sent them."""
        from o80.frontend.running_request import RunningRequest

        return [RunningRequest(*fields) for fields in self._running_requests]
