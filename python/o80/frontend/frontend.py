"""The class Frontend, frontend classes of single robots, and a wait for several frontends."""

import contextlib
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, Self, cast

import o80._core as _core
from o80.base import lifecycle
from o80.base.cached import cached
from o80.base.errors import Error, InvalidArgument, SchemaMismatch, UsedAfterFork
from o80.base.installation import announced
from o80.base.signatures import explains
from o80.base.words import OnErrorWord, RowsWord
from o80.frontend.commander import Commander
from o80.rows.layout import Layout

if TYPE_CHECKING:
    from fractions import Fraction

    from o80.frontend.aio import Waits
    from o80.frontend.chunks import Chunks

GROUP = "o80.frontends"

_registered: dict[str, type["Frontend"]] = {}


@explains
class Frontend(Commander, lifecycle.Managed):
    """A frontend of the backend that owns a segment: sends commands, reads observations.

    segment: name of the segment.
    timeout: how long to wait for the backend [s]; None is for ever.
    read_only: attach without the right to command.
    on_error: if the `with` block ends by an exception or Ctrl-C, "purge" drops the commands of this
        frontend, "continue" keeps them.
    dead: attach also to a backend that has ended, to read its history.

    May be used from several threads: all of them add to one buffer, and any pulse sends it. In a
    forked child its calls raise UsedAfterFork. A pickled frontend attaches again by name.
    Raises TimeoutError without a backend, SegmentError for an unreadable one, BackendFailed.
    Returns an object of the robot's own frontend class if its package registers one.
    """

    _is_set_up = False
    _attachment: _core.Attachment  # from __new__ to __init__
    _arguments: dict[str, Any] | None

    def __new__(
        cls,
        segment: str,
        timeout: float | None = 5.0,
        *,
        read_only: bool = False,
        on_error: OnErrorWord = "purge",
        dead: bool = False,
    ) -> Self:
        attachment = _core.attach(segment, timeout, read_only, dead)
        chosen = class_of(attachment.robot) if cls is Frontend else None
        self = super().__new__(cls if chosen is None else cast(type[Self], chosen))
        self._attachment = attachment
        return self

    def __init__(
        self,
        segment: str,
        timeout: float | None = 5.0,
        *,
        read_only: bool = False,
        on_error: OnErrorWord = "purge",
        dead: bool = False,
    ) -> None:
        if on_error not in ("purge", "continue"):
            raise InvalidArgument(f"on_error must be 'purge' or 'continue', got {on_error!r}")
        self._on_error = on_error
        self._unnamed = False
        self._arguments = {"segment": segment, "timeout": timeout, "read_only": read_only}
        self._arguments |= {"on_error": on_error, "dead": dead}
        self._set_up(self.__dict__.pop("_attachment"))

    @classmethod
    def _of(cls, attachment: _core.Attachment, *, unnamed: bool) -> "Frontend":
        """Makes the frontend of an inline robot. unnamed: o80 chose the segment's name."""
        chosen = class_of(attachment.robot) or cls
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
        self._open_plans = set()
        self._first = self._read(self.oldest, 1) if self.published >= 0 else None
        self._is_set_up = True
        lifecycle.close_later(self)

    def chunks(
        self,
        actuators: int | str | Sequence[int | str] | None = None,
        *,
        step: "float | Fraction",
        ease: float | None = None,
        profile: RowsWord = "smooth",
        ensemble: float | None = None,
        clip: bool = False,
    ) -> "Chunks":
        """Opens a plan for a policy that returns rows of targets, late (docs/chunks.md).

        actuators: indices or names, also of groups, of any types (None: all).
        step: iterations from row to row, whole or a fraction (50 / 3: 30 rows a second at 500 Hz).
        ease: iterations of a take-over, or as a float its time [s] (None: as many as the limits
            need, at least a step and at most half of the rows ahead; without a limit of
            acceleration 0.1 s, or a step if that is longer).
        profile: between rows: "smooth", a curve through them; "monotone", one that stays between
            them; "linear"; or "hold".
        ensemble: mix each new row with the plan, as ACT does: share exp(-ensemble * i) of the i-th
            answer for an iteration (None: new rows replace the plan).
        clip: True moves numbers of rows outside minimum and maximum to these bounds, and counts
            them in `clipped` of the sent chunk, instead of refusing the chunk.

        with arm.chunks(["shoulder", "elbow"], step=10) as plan:
            seen = plan.wait(lead=120)
            plan.send(policy(seen), seen=seen)
        """
        from o80.frontend.chunks import Chunks

        return Chunks(
            self, actuators, step=step, ease=ease, profile=profile, ensemble=ensemble, clip=clip
        )

    @cached
    def aio(self) -> "Waits":
        """The waiting methods as asyncio coroutines: `await arm.aio.wait_for_next()`."""
        from o80.frontend.aio import Waits  # here, because most programs do not need asyncio

        return Waits(self)

    def close(self) -> None:
        """Closes the frontend. Sent commands continue; its plans of chunks are closed; an inline
        robot stops.

        May be called twice. Calls that wait in other threads raise Closed. In a forked child it
        does not affect the parent.
        """
        if self.closed:
            return
        added = 0 if self._forked else self.added
        if added:
            warnings.warn(
                f"{added} commands were added to '{self.segment}' and never pulsed",
                ResourceWarning,
                stacklevel=3,
            )
        if self._open_plans and not self._forked:
            with contextlib.suppress(Error):
                self._close_plan(0)
        self._close()
        if self._unnamed and not self._forked:  # the segment of a failed robot would remain
            _core.clean(self.segment)

    def _close_at_exit(self) -> None:
        """Closes the frontend at exit, unless it only reads: daemon threads may wait with it."""
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
        """Attaches to the backend that has the name now, after the former backend has ended.

        Raises TimeoutError, SchemaMismatch if the robot is described differently, and Closed.
        """
        if self._arguments is None:
            raise InvalidArgument("an inline robot cannot be attached again: start a new one")
        segment = self._arguments["segment"]
        attachment = self._attach_again(timeout, self._arguments["read_only"])
        difference = _core.difference(self._description, attachment.description)
        if difference:
            raise SchemaMismatch(
                f"'{segment}' is described differently now; open a new frontend:\n{difference}"
            )
        decoder = _core.Decoder(attachment.description, self._layout)
        self._reattach(attachment, decoder)
        self._description, self._decoder = attachment.description, decoder

    def _leave(self, error: BaseException | None) -> None:
        if error is not None and not self.closed and not self._forked:
            self.forget_added()
            self._purge_on_error()
        self.close()

    def __reduce__(self) -> tuple[Callable[..., "Frontend"], tuple[Any, ...]]:
        if self._arguments is None:
            raise TypeError(
                f"the frontend of an inline robot cannot be pickled: it lives in this process. "
                f"Attach to its segment: o80.Frontend({self.segment!r})"
            )
        return partial(type(self), **self._arguments), ()

    def __repr__(self) -> str:
        try:
            state: str = "closed" if self.closed else self.life
            if state == "running":
                state = f"{'bursting' if self.bursting else 'running'} at {self.frequency:g} Hz"
                if (halt := self.halted) is not None:
                    state += f", halted: {halt.text}" if halt.text else ", halted"
        except UsedAfterFork:
            state = "of the parent process"
        return f"<o80.{type(self).__name__} of '{self.segment}' ({self.robot}), {state}>"


def register_frontend(robot: str, cls: type["Frontend"]) -> None:
    """Registers a subclass that `o80.Frontend(...)` returns for segments of this robot.

    A package can do the same with an entry point of the group "o80.frontends".
    """
    _registered[robot] = cls


def class_of(robot: str) -> type["Frontend"] | None:
    """Returns the frontend class of that robot, or None."""
    if robot not in _registered and robot in announced(GROUP):
        _registered[robot] = announced(GROUP)[robot].load()
    return _registered.get(robot)


def wait_for_first(
    members: Iterable[Frontend] | Mapping[Frontend, int], timeout: float | None = None
) -> dict[Frontend, _core.Observation]:
    """Waits until the first of several backends has published a row.

    members: frontends, for the next observation of each, as with `Frontend.wait_for_next`; or a
        mapping from frontends to iterations.
    timeout: for the first row [s].

    Returns the published observations, of one frontend or more. Raises TimeoutError, and
    BackendGone with the segment's name if a backend ends before any row is published. The call
    needs no thread and does not poll: it sleeps on all segments at once. Only with read-only
    frontends, and on Linux before 5.16, it polls every millisecond.
    """
    wanted: list[tuple[Frontend, int | None]] = (
        list(members.items())
        if isinstance(members, Mapping)
        else [(member, None) for member in dict.fromkeys(members)]
    )
    for member, _ in wanted:
        if not isinstance(member, Frontend):
            raise InvalidArgument(f"members must be frontends of o80, got {member!r}")
    found = _core.wait_for_first(wanted, timeout)
    by_member: dict[_core.Frontend, _core.Observation] = dict(found)
    return {member: by_member[member] for member, _ in wanted if member in by_member}
