"""The side that commands and reads."""

import contextlib
import threading
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cached_property
from types import TracebackType
from typing import Any, Literal, Self, cast, overload

import numpy as np
from numpy.typing import ArrayLike

from o80 import _core, at_exit, frontend_classes
from o80.actuator import Actuator, actuators_of
from o80.checked import whole, whole_or_none
from o80.errors import (
    BackendGone,
    BackendHalted,
    Closed,
    ControlTaken,
    Error,
    InvalidArgument,
    NotBursting,
    RequestRejected,
    SchemaMismatch,
    TimeoutError,
    UsedAfterFork,
)
from o80.halts import Halt
from o80.history import History
from o80.layout import Layout
from o80.prepared_burst import PreparedBurst, checked_count
from o80.running_request import RunningRequest
from o80.trajectory import common_type, states_of, times_of
from o80.words import Status


class Frontend(_core.Frontend):
    """A frontend of the backend that owns a segment: sends commands, reads observations.

    segment: its name.
    timeout: how long to wait for the backend [s]; None is for ever.
    read_only: asks for no right to command.
    on_error: what becomes of sent motion if the `with` block ends by an exception or Ctrl-C:
        "purge" drops what this frontend sent, "continue" leaves it.
    dead: attaches also to a backend that is gone, to read its history.

    May be used from several threads: what they add is one buffer, which any pulse sends. In a
    forked child its calls raise UsedAfterFork; pickled, it is opened again by its name.
    Raises TimeoutError, SegmentError, BackendFailed.
    If the robot's package has a class of its own for it, that one is made.
    """

    _is_set_up = False
    _attachment: _core.Attachment  # from __new__ to __init__
    _arguments: tuple[str, float | None, bool, Literal["purge", "continue"], bool] | None

    def __new__(
        cls,
        segment: str,
        timeout: float | None = 5.0,
        *,
        read_only: bool = False,
        on_error: Literal["purge", "continue"] = "purge",
        dead: bool = False,
    ) -> Self:
        attachment = _core.attach(segment, timeout, read_only, dead)
        chosen = frontend_classes.of(attachment.robot) if cls is Frontend else None
        self = super().__new__(cls if chosen is None else cast(type[Self], chosen))
        self._attachment = attachment
        return self

    def __init__(
        self,
        segment: str,
        timeout: float | None = 5.0,
        *,
        read_only: bool = False,
        on_error: Literal["purge", "continue"] = "purge",
        dead: bool = False,
    ) -> None:
        if on_error not in ("purge", "continue"):
            raise InvalidArgument(f"on_error cannot be {on_error!r}: it is 'purge' or 'continue'")
        self._on_error = on_error
        self._unnamed = False
        self._arguments = (segment, timeout, read_only, on_error, dead)
        self._set_up(self.__dict__.pop("_attachment"))

    @classmethod
    def _of(cls, attachment: _core.Attachment, *, unnamed: bool) -> "Frontend":
        """The frontend of an inline robot; unnamed: nobody chose its segment's name."""
        chosen = frontend_classes.of(attachment.robot) or cls
        self = _core.Frontend.__new__(chosen)
        assert isinstance(self, Frontend)
        self._on_error = "purge"
        self._arguments = None
        self._unnamed = unnamed
        self._set_up(attachment)
        return self

    def _set_up(self, attachment: _core.Attachment) -> None:
        self._description = attachment.description
        self._layout = Layout(self._description)
        self._decoder = _core.Decoder(self._description, self._layout)
        super().__init__(attachment, self._decoder)
        self._first = self._read(self.oldest, 1) if self.published >= 0 else None
        self._control_lock = threading.Lock()
        self._control_blocks = 0
        self._is_set_up = True
        at_exit.close_later(self)

    # ------------------------------------------------------------------ commanding

    def add_trajectory(
        self,
        targets: ArrayLike | Mapping[str, ArrayLike],
        actuators: int | str | Sequence[int | str] | None = None,
        *,
        iterations: int | None = None,
        times: ArrayLike | None = None,
        speed: float | None = None,
        mode: str = "queue",
        profile: str = "linear",
        start: str = "desired",
    ) -> None:
        """Adds one command through many states, for one or several actuators.

        targets: (T, actuators), row after row; (T,) for a single actuator. Numbers for states of
            one number, else a structured array, or a mapping from each field to an array.
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

    @overload
    def burst(
        self,
        iterations: int = 1,
        *,
        timeout: float | None = None,
        wait: Literal[True] = True,
        at: int | None = None,
        late: str = "reject",
    ) -> _core.Observation: ...
    @overload
    def burst(
        self,
        iterations: int = 1,
        *,
        timeout: float | None = None,
        wait: Literal[False],
        at: int | None = None,
        late: str = "reject",
    ) -> _core.Burst: ...
    def burst(
        self,
        iterations: int = 1,
        *,
        timeout: float | None = None,
        wait: bool = True,
        at: int | None = None,
        late: str = "reject",
    ) -> _core.Observation | _core.Burst:
        """Sends what was added and lets a bursting backend run exactly so many iterations.

        at: the iteration at which what was added is taken, of this burst or a later one (None: the
            first of this burst).
        late: what if that iteration has begun: "reject" the batch, which then does not burst, or
            take it "now".

        Returns the observation of the last iteration; with `wait=False` a Burst, to be waited for
        or cancelled. A call that ends without its last row (a timeout, Ctrl-C) cancels the rest of
        its burst: the backend stands still again after the iteration under way. So do the end of
        this frontend and its death. `prepared_burst` does the same many times, faster.

        Raises NotBursting, TimeoutError after `timeout` [s], BackendGone, LaneFull,
        InvalidArgument.
        """
        if wait:
            return self._burst(iterations, timeout, at, late)
        return self._start_burst(iterations, at, late)

    def prepared_burst(
        self,
        iterations: int = 1,
        actuators: int | str | Sequence[int | str] | None = None,
        *,
        steps: int = 1,
        each: int = 1,
        mode: str = "queue",
        profile: str = "linear",
        start: str = "desired",
    ) -> PreparedBurst:
        """A burst to be made again and again: targets in, iterations, all their rows out.

        iterations: of each burst.
        actuators: which ones get targets, by index or name (None: all).
        steps: how many targets each of them gets for a burst.
        each: iterations to reach each target.
        mode, profile, start: as in add_command.

        Raises NotBursting, InvalidArgument.
        """
        self._check_usable()
        if not self.bursting:
            raise NotBursting(
                f"'{self.segment}' runs by its own clock and cannot be burst: "
                "start it with bursting"
            )
        chosen, _ = self._chosen(actuators)
        shape = len(chosen), checked_count(steps, "steps")
        return PreparedBurst(
            self,
            chosen,
            np.empty(shape, common_type(chosen, self._layout)),
            np.zeros(checked_count(iterations, "iterations"), self._layout.row),
            pace=(checked_count(each, "each"), mode, profile, start),
        )

    @contextlib.contextmanager
    def control(self, timeout: float | None = 5.0) -> Iterator[Self]:
        """Exclusive control within a `with` block: batches of other frontends are rejected.

        Blocks of one frontend may nest or overlap: control ends with the last of them.
        Raises ControlTaken, naming the holder, if another frontend has it.
        """
        self._check_usable()
        with self._control_lock:
            batch = self._take_control()
            self._control_blocks += 1
        try:
            batch.wait(timeout)
        except BaseException:
            # it may be given yet
            with contextlib.suppress(Error):
                self._leave_control()
            raise
        handle = batch.handles[0]
        if handle.status != Status.COMPLETED:
            with self._control_lock:
                self._control_blocks -= 1
            raise ControlTaken(f"no control of '{self.segment}': {handle.text}")
        try:
            yield self
        finally:
            with contextlib.suppress(BackendGone, Closed):
                if (released := self._leave_control()) is not None:
                    released.wait(timeout)

    def _leave_control(self) -> _core.Batch | None:
        """A block ends; the last one releases control."""
        self._check_usable()
        with self._control_lock:
            self._control_blocks -= 1
            return self._release_control() if self._control_blocks == 0 else None

    # ------------------------------------------------------------------ halts

    @property
    def halted(self) -> Halt | None:
        """The halt that acts, or None. Asked for a moment ago, its iteration is None."""
        fields = self._halted
        if fields is None:
            return None
        number, cause, iteration, who, text = fields
        return Halt(number, cause, None if iteration < 0 else iteration, who, text)

    def resume(self, number: int | None = None, *, timeout: float | None = 5.0) -> None:
        """Ends a halt: the robot starts afresh from where it is, with nothing queued.

        number: of the halt that was looked at (None: the one that acts now). A halt that came after
            it stands.
        timeout: for the halt to act, the robot to come to rest, and the backend's answer [s].

        Needs a lane, but no control. In bursting it does not wait for the robot to rest: burst
        until it does.

        Raises BackendHalted if it is refused: another halt came, the robot refuses, or it still
        brakes and bursts. Raises TimeoutError, NoLane, BackendGone.
        Does nothing if no halt acts.
        """
        if number is None:
            halt = self.halted
            if halt is None:
                return
            number = halt.number
        self._resume(whole(number, "the number of a halt", 1), timeout)

    # ------------------------------------------------------------------ observing

    def history(
        self, n: int | None = None, *, since: int | None = None, until: int | None = None
    ) -> History:
        """The last n observations, or those of the iterations `since` to `until`, both included.

        None of them: all that are still there. What is no longer there is left out.
        """
        n = whole_or_none(n, "n, the number of observations,")
        since = whole_or_none(since, "since")
        until = whole_or_none(until, "until")
        oldest, last = self.oldest, self.published
        if n is not None and (since is not None or until is not None):
            raise InvalidArgument("give either n, or since and until")
        if n is not None and n < 0:
            raise InvalidArgument(f"a history of {n} observations: it cannot be negative")
        if until is not None:
            last = min(last, until)
        first = oldest if n is None else max(oldest, last + 1 - n)
        if since is not None:
            first = max(first, since)
        return self._read(first, max(0, last + 1 - first))

    def _read(self, first: int, count: int) -> History:
        rows = np.empty(count, self._layout.row)
        _, found = self._read_rows(first, rows.view(np.uint8)) if count else (first, 0)
        return History(self._decoder, rows[:found])

    @property
    def initial_states(self) -> Any:
        """The observed states of row 0, before anything was asked.

        If that row was overwritten before this frontend attached: of the oldest row it found.
        """
        if self._first is None or not len(self._first):
            raise Error(f"'{self.segment}' had no row yet when this frontend attached")
        return self._first[0].observed

    # ------------------------------------------------------------------ the robot

    @property
    def schema(self) -> dict[str, Any]:
        """All that the backend says of its robot."""
        return self._layout.schema

    @property
    def robot(self) -> str:
        """The name of the robot."""
        name: str = self.schema["robot"]
        return name

    @cached_property
    def actuators(self) -> list[Actuator]:
        """What can be commanded: index, name, unit, limits."""
        return actuators_of(self.schema)

    @property
    def requests(self) -> dict[str, str]:
        """The requests that the driver serves, each with its help."""
        return {request["name"]: request["help"] for request in self.schema["requests"]}

    @property
    def running_requests(self) -> list[RunningRequest]:
        """The requests that take time and have not ended, oldest first, whoever sent them."""
        return [RunningRequest(*fields) for fields in self._running_requests]

    @property
    def enums(self) -> dict[str, Any]:
        """An IntEnum for each enumerated field, by its name."""
        return self._layout.enums

    @property
    def period(self) -> float:
        """Of the iterations [s]."""
        nanoseconds: int = self.schema["period"]
        return nanoseconds * 1e-9

    @property
    def frequency(self) -> float:
        """Iterations a second [1/s]."""
        nanoseconds: int = self.schema["period"]
        return 1e9 / nanoseconds

    @property
    def alive(self) -> bool:
        """Whether the backend lives."""
        return self.life in ("starting", "running")

    # ------------------------------------------------------------------ its life

    def close(self) -> None:
        """Ends it: sent motion goes on, an inline robot stops. Closing twice is allowed.

        Calls that wait in other threads raise Closed. In a forked child nothing of the parent's
        is touched.
        """
        if self.closed:
            return
        added = 0 if self._forked else self.added
        if added:
            warnings.warn(
                f"{added} commands were added to '{self.segment}' and never pulsed",
                ResourceWarning,
                stacklevel=2,
            )
        self._close()
        if self._unnamed and not self._forked:  # one that failed would stay, for others to read
            _core.clean(self.segment)

    def _close_at_exit(self) -> None:
        """A pure reader has nothing to give back: who waits in a daemon thread is left alone."""
        if not self.closed and (self._is_inline or self._has_lane or self.added):
            self.close()

    def __del__(self) -> None:
        if not self._is_set_up or self.closed:
            return
        if self._is_inline and not self._forked:
            warnings.warn(
                f"the inline robot '{self.segment}' was never closed", ResourceWarning, stacklevel=2
            )
        self.close()

    def reattach(self, timeout: float | None = 5.0) -> None:
        """Attaches to the backend that now owns the name, after the former one ended.

        Raises TimeoutError, SchemaMismatch if it is described otherwise, and Closed.
        """
        if self._arguments is None:
            raise InvalidArgument("an inline robot that ended cannot be attached again: start it")
        segment, _, read_only, *_ = self._arguments
        attachment = self._attach_again(timeout, read_only)
        difference = _core.difference(self._description, attachment.description)
        if difference:
            raise SchemaMismatch(
                f"'{segment}' is no longer the robot it was; open a new frontend:\n{difference}"
            )
        self._reattach(attachment)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if error is not None and not self.closed and not self._forked:
            self.forget_added()
            if self._on_error == "purge":
                with contextlib.suppress(Error):
                    self._purge_own()
        self.close()

    def __reduce__(self) -> tuple[Callable[..., "Frontend"], tuple[Any, ...]]:
        if self._arguments is None:
            raise TypeError(
                f"the frontend of an inline robot cannot be pickled: it lives in this process. "
                f"Attach to its segment: o80.Frontend({self.segment!r})"
            )
        return _open_again, (type(self), *self._arguments)

    def __repr__(self) -> str:
        try:
            state = "closed" if self.closed else self.life
        except UsedAfterFork:
            state = "of the parent process"
        return f"<o80.{type(self).__name__} of '{self.segment}' ({self.robot}), {state}>"


def _open_again(
    cls: type[Frontend],
    segment: str,
    timeout: float | None,
    read_only: bool,
    on_error: Literal["purge", "continue"],
    dead: bool,
) -> Frontend:
    """A pickled frontend attaches again by name."""
    return cls(segment, timeout, read_only=read_only, on_error=on_error, dead=dead)
