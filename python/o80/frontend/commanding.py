"""How a frontend commands: what it adds to a batch, and how it sends it."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, SupportsIndex

import numpy as np
from numpy.typing import ArrayLike

from o80 import _core
from o80.errors import BackendHalted, InvalidArgument, RequestRejected, TimeoutError
from o80.frontend.observing import Observing
from o80.running_request import RunningRequest
from o80.trajectory import states_of, times_of
from o80.words import LateWord, ModeWord, OnLimitWord, ProfileWord, StartWord, Status


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
            on_limit: OnLimitWord = "end",
        ) -> None:
            """Adds a command to what the next pulse sends.

            actuator: its index or its name; several, or None for all, for one command that they
                carry out together: it begins when all their queues have come to it, takes as many
                iterations as the slowest of them, and has one status. It needs one target for each.
            target: the state to reach, in the unit of its field. A number is its first field (or
                the state, if that is one number); otherwise a mapping, a record, or all fields in
                order. Fields that are left out keep their desired value.
            duration: time to get there [s].
            speed: peak speed of the first number that is given [its unit/s].
            until: the iteration at which to be there.
            iterations: how many iterations to take.
            fastest: as fast as the limits of speed, acceleration and jerk allow, at rest at the
                end. Give one of these five, or none to be there in one iteration.
            mode: "queue" (after what is there) or "overwrite" (instead of what is there).
            profile: "linear" or "minimum_jerk" (None: linear, or minimum_jerk where the actuator
                has acceleration limits).
            start: "desired" or "observed", the state to start from.
            on_limit: of a command without a pace that the limits do not let arrive in its
                iteration: "end" (as limited, and the actuator comes to rest) or "go_on" (to the
                target, as fast as they allow).

            Raises InvalidArgument for what the robot cannot follow.
            """

        def add_request(self, name: str, /, **fields: Any) -> None:
            """Adds a request to what the next pulse sends.

            It is served in order with the commands of that pulse. Every field without a default
            must be given; `o80 info` shows the defaults.
            """

        def add_purge(self, actuator: SupportsIndex | str | None = None) -> None:
            """Adds a purge (of one actuator, or of all) to what the next pulse sends."""

        @property
        def added(self) -> int:
            """How many commands, requests and purges were added and not pulsed."""

        def forget_added(self) -> None:
            """Drops what was added and not pulsed."""

        def pulse(self, *, at: int | None = None, late: LateWord = "reject") -> _core.Batch:
            """Sends what was added, as one batch; does not wait.

            at: the iteration at which the batch is taken (None: at once).
            late: what if that iteration has begun: "reject" the batch, or take it "now".

            Raises LaneFull if too much is in flight (nothing is sent, all stays added), NoLane,
            ReadOnly, BackendGone.
            """

        def pulse_and_wait(
            self,
            timeout: float | None = None,
            *,
            at: int | None = None,
            late: LateWord = "reject",
        ) -> _core.Observation:
            """Sends what was added and waits until all of it has ended.

            A bursting backend runs as long as that takes. Returns the observation of the last
            iteration. What was rejected, purged or limited raises nothing: pulse and the statuses
            of its batch tell.

            Raises TimeoutError after `timeout` [s], which carries the `batch`, and what pulse
            raises.
            """

        def purge(self, actuator: SupportsIndex | str | None = None) -> _core.Batch:
            """Drops all commands of an actuator (None: of all), whoever sent them, at once.

            Needs no pulse; what was added and not pulsed stays added.
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
    ) -> None:
        """Adds one command through many states, for one or several actuators.

        targets: (T, actuators), row after row; (T,) for a single actuator. Numbers for states of
            one number; else every field, in a structured array or a mapping from each field to an
            array.
        actuators: which ones, by index or name (None: all).
        iterations: of each row (default: 1).
        times: when each row is reached, since the start [s]: (T,), not falling.
        speed: at which to go to each row, as in add_command.
        mode, profile, start: as in add_command.

        Several actuators go through each row together, as in add_command. All of it is added or,
        if InvalidArgument is raised, none.
        """
        if times is not None and (iterations is not None or speed is not None):
            raise InvalidArgument(
                "a trajectory has one pace: give one of iterations, times and speed"
            )
        if times is None and speed is None and iterations is None:
            iterations = 1
        chosen, single = self._chosen(actuators)
        states, rows = states_of(targets, chosen, single, self._layout)
        self._add_trajectories(
            chosen,
            rows,
            states,
            None if times is None else times_of(times),
            speed,
            iterations,
            mode,
            profile,
            start,
        )

    def _chosen(self, actuators: int | str | Sequence[int | str] | None) -> tuple[list[int], bool]:
        """Indices, and whether one actuator was named alone."""
        if actuators is None:
            return list(range(len(self.actuators))), False
        if isinstance(actuators, (int, str, np.integer)):
            return [self._index(actuators)], True
        return [self._index(actuator) for actuator in actuators], False

    def request(self, name: str, /, *, timeout: float | None = None, **fields: Any) -> None:
        """Sends a request to the driver at once and waits for its answer.

        name: of the request; `requests` lists them.
        timeout: for the answer, and, if the request takes time, for its end [s].
        fields: of the request; those that have a default may be left out.

        It needs no pulse; what was added and not pulsed stays added. A bursting backend runs until
        the request has ended. Raises RequestRejected with the driver's text, BackendHalted if a
        halt ended it, BackendGone, and TimeoutError, whose `batch` can be waited for again: the
        request goes on. `add_request` makes one part of a pulse, and waits for nothing.
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
                f"'{name}' of '{self.segment}' still runs{progress}, and goes on: give it more "
                f"time, or wait for the `batch` of this error",
                batch,
            ) from error
        handle = batch.handles[0]
        if handle.status == Status.HALTED:
            raise BackendHalted(f"'{name}' of '{self.segment}' was ended: {handle.text}")
        if handle.status != Status.COMPLETED:
            raise RequestRejected(f"'{self.segment}' did not serve '{name}': {handle.text}")

    @property
    def running_requests(self) -> list[RunningRequest]:
        """The requests that take time and have not ended, oldest first, whoever sent them."""
        return [RunningRequest(*fields) for fields in self._running_requests]
