"""Exceptions of o80: one class for each cause. The text says what to do."""

import builtins
from typing import TYPE_CHECKING, Any, NamedTuple, Optional

from o80.base.symptoms import page_about

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from o80._core import Batch, Handle, Observation
    from o80.base.words import CommandEnd


def exception_text(error: BaseException) -> str:
    """Returns type and text of any exception, also if its own `__str__` fails."""
    try:
        text = str(error)
    except Exception:
        text = ""
    return f"{type(error).__name__}: {text}" if text else type(error).__name__


def sentence(text: object) -> str:
    """Returns a text with a full stop, unless it ends a sentence already."""
    return str(text) if str(text).endswith((".", "!", "?")) else f"{text}."


class Error(Exception):
    """Base class of all exceptions of o80. A note of it may name a page about the symptom."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        if page := page_about(exception_text(self)):
            self.add_note(page)


class InvalidArgument(Error, ValueError):
    """An argument has a value that cannot be used; the text names it and what is allowed."""


class TimeoutError(Error, builtins.TimeoutError):
    """A wait ended by its timeout.

    `batch` is the batch of the wait, or None: wait again, or inspect its `handles`.
    """

    def __init__(
        self, text: str = "", batch: Optional["Batch"] = None, handles: "Sequence[Handle]" = ()
    ) -> None:
        super().__init__(text)
        self.batch = batch
        self._handles = handles

    @property
    def handles(self) -> "Sequence[Handle]":
        """Handles of the batch, with their statuses; empty if there is no batch."""
        return list(self._handles) if self.batch is None else self.batch.handles

    def __reduce__(self) -> tuple[Any, ...]:
        # another process cannot wait for the batch: keep the statuses
        return type(self), (str(self), None, self.handles)


class NotCompleted(Error):
    """Commands or requests of a batch did not complete, or the whole batch was rejected.

    Commands that a later command of the same frontend has overwritten do not count.

    handles: handles that did not complete, with their statuses.
    observation: the row of the last iteration of the batch (the newest row if that one is gone).
    """

    def __init__(
        self,
        text: str,
        handles: "Sequence[Handle]",
        actuators: "Sequence[tuple[str, ...]]",
        observation: "Observation",
    ) -> None:
        super().__init__(text)
        self.handles = list(handles)
        self._actuators = list(actuators)
        self.observation = observation

    @property
    def ends(self) -> "list[CommandEnd]":
        """For each handle: iteration, status, actuators, reason and text."""
        from o80.base.words import CommandEnd

        return [
            CommandEnd(handle.iteration or 0, handle.status, names, handle.reason, handle.text)
            for handle, names in zip(self.handles, self._actuators, strict=True)
        ]

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (str(self), self.handles, self._actuators, self.observation)


class Miss(NamedTuple):
    """A number that was observed too far from its target; part of a NotReached."""

    actuator: str
    field: str  #: empty if the state is a number
    target: float
    observed: float
    distance: float  #: NaN if `observed` is
    tolerance: float
    unit: str  #: of the four numbers


class NotReached(TimeoutError):
    """The robot was not observed within the tolerance of its targets in time.

    misses: the numbers that were too far away; empty if only the commands had not ended.
    observation: the row in which they were observed.
    batch: the commands; commands that have not ended continue. `handles` are those of the batch.
    """

    def __init__(
        self,
        text: str,
        batch: Optional["Batch"],
        handles: "Sequence[Handle]",
        misses: "Sequence[Miss]",
        observation: "Observation",
    ) -> None:
        super().__init__(text, batch, handles)
        self.misses = list(misses)
        self.observation = observation

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (str(self), None, self.handles, self.misses, self.observation)


class MissingExtra(Error, ImportError):
    """A function needs an optional package; the text names the extra of o80 that installs it."""


class SegmentTaken(Error):
    """A living backend has the segment's name: stop it (`o80 stop`), or choose another name."""


class SegmentError(Error):
    """A segment cannot be created, opened or listed.

    The text says why, and what to do: another version of o80, no room, no right, another owner.
    """


class SchemaMismatch(Error):
    """The robot is described differently than expected; the text has the differences.

    Open a new frontend, make the module of `o80 stub` again, or start the robot that was meant.
    """


class BackendGone(Error):
    """The backend no longer iterates: start the robot again, then call `reattach`."""


class BackendHalted(Error):
    """The backend is halted: commands end or are rejected until a frontend resumes it.

    The text has the reason of the halt. Remove it, then `o80 resume NAME NUMBER`, or `resume`.
    """


class BackendStopped(BackendGone):
    """The backend ended in order: start the robot again."""


class BackendFailed(BackendGone):
    """The driver reported a fault, which is the text: remove it, then start the robot again."""


class BackendKilled(BackendGone):
    """The process of the backend died. Its successor starts halted if commands acted.

    `o80 save` keeps the last rows, if it comes before the robot is started again.
    """


class BackendSuperseded(BackendGone):
    """A new backend has taken the name: call `reattach`, or open a new frontend."""


class RowOverwritten(Error, LookupError):
    """The history no longer holds that iteration: read earlier, or give a longer `history`."""


class LaneFull(Error):
    """The lane has no room for the batch; nothing was sent, and what was added stays added.

    Wait until earlier batches have ended, or start the robot with more `lane_blocks`.
    """


class NoLane(Error):
    """All lanes of the segment are in use by other frontends: close one, or give more `lanes`."""


class NotBursting(Error, RuntimeError):
    """A burst was requested from a backend that runs in real time: start it with `bursting`."""


class ReadOnly(Error, RuntimeError):
    """The frontend may only read: `read_only=True`, its permission, or a recording being played."""


class UsedAfterFork(Error, RuntimeError):
    """The object belongs to the parent process: open a frontend in the child."""


class Closed(Error, RuntimeError):
    """The object was closed: open a new one."""


class Cancelled(Error):
    """A wait was cancelled by its caller."""


class DriverError(Error, RuntimeError):
    """A robot library or its driver failed; the text is that of the driver or of the loader."""


class CopyFailed(Error):
    """Copies of an inline group failed in a call; all other copies have completed it.

    The text names the copies. `errors` has the exception of each; the first one is the cause.
    """

    def __init__(self, text: str = "", errors: "Mapping[int, Exception] | None" = None) -> None:
        super().__init__(text)
        self.errors: dict[int, Exception] = dict(errors or {})

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (str(self), self.errors)


class RequestRejected(Error):
    """A request was rejected; the text is the reason.

    The handler of an embedded backend raises it to reject a request; the sender reads the text.
    """


class ControlTaken(Error):
    """Another frontend has exclusive control: wait until it releases it."""


class RecordingError(Error):
    """A recording cannot be written or read; the text names the file and what to do."""


for _class in [*vars().values()]:  # shown and pickled by the name under which users import them
    if isinstance(_class, type) and _class.__module__ == __name__:
        _class.__module__ = "o80.errors"
