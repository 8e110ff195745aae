"""What o80 raises: one class a cause, with the cure in its text."""

import builtins
from typing import TYPE_CHECKING, Any, Optional

if TYPE_CHECKING:
    from collections.abc import Sequence

    from o80._core import Batch, Handle


class Error(Exception):
    """Base of everything o80 raises."""


class InvalidArgument(Error, ValueError):
    """A value that was given cannot be used."""


class TimeoutError(Error, builtins.TimeoutError):
    """A wait ended without its result.

    `batch` is what was waited for, if it was a batch: wait again, or ask its `handles`.
    """

    def __init__(
        self, text: str = "", batch: Optional["Batch"] = None, handles: "Sequence[Handle]" = ()
    ) -> None:
        super().__init__(text)
        self.batch = batch
        self._handles = handles

    @property
    def handles(self) -> "Sequence[Handle]":
        """Of what was waited for, with their statuses; none if it was no batch."""
        return list(self._handles) if self.batch is None else self.batch.handles

    def __reduce__(self) -> tuple[Any, ...]:
        # in another process there is no batch to wait for, but there is what became of it
        return type(self), (str(self), None, self.handles)


class SegmentTaken(Error):
    """The name already has a living backend."""


class SegmentError(Error):
    """The file cannot be a segment of this o80, or cannot be made."""


class SchemaMismatch(Error):
    """The robot is not described as it was expected."""


class BackendGone(Error):
    """The backend no longer iterates."""


class BackendHalted(Error):
    """The backend is halted: commands end or are refused until somebody resumes it."""


class BackendStopped(BackendGone):
    """The backend ended in order."""


class BackendFailed(BackendGone):
    """The driver reported a fault."""


class BackendKilled(BackendGone):
    """The process of the backend died."""


class BackendSuperseded(BackendGone):
    """A new backend took the name: `reattach`, or open a new frontend."""


class RowOverwritten(Error, LookupError):
    """The history no longer holds that iteration."""


class LaneFull(Error):
    """Too much is in flight; nothing was sent."""


class NoLane(Error):
    """As many frontends command as the segment has lanes."""


class NotBursting(Error, RuntimeError):
    """A burst was asked of a backend that runs by the clock."""


class ReadOnly(Error, RuntimeError):
    """The frontend was opened to read only."""


class UsedAfterFork(Error, RuntimeError):
    """The object belongs to the parent process."""


class Closed(Error, RuntimeError):
    """The object was closed."""


class Cancelled(Error):
    """A wait was ended by its caller."""


class DriverError(Error, RuntimeError):
    """A robot library or its driver failed."""


class RequestRejected(Error):
    """A request was not served; the text says why.

    Raised by a handler of an embedded backend, it is what the sender reads.
    """


class ControlTaken(Error):
    """Another frontend has exclusive control."""
