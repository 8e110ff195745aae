"""String enumerations of the API.

Arguments accept the aliases at the end: a member of an enumeration, or the string itself.
"""

from enum import StrEnum
from typing import Literal, NamedTuple, TypeAlias


class Mode(StrEnum):
    """The place of a command in the queue of its actuator."""

    QUEUE = "queue"  #: after the queued commands
    OVERWRITE = "overwrite"  #: instead of the queued commands


class Profile(StrEnum):
    """Interpolation between two states."""

    LINEAR = "linear"
    MINIMUM_JERK = "minimum_jerk"
    AS_SENT = "as_sent"  #: no interpolation: each target in its iteration, where limits allow
    MONOTONE = "monotone"  #: of rows: a curve through them that stays between them
    HOLD = "hold"  #: of rows: each from the iteration after the one before it
    SMOOTH = "smooth"  #: of rows: a curve through them, as of samples of a smooth motion


class Start(StrEnum):
    """The state a command starts from."""

    DESIRED = "desired"
    OBSERVED = "observed"


class Status(StrEnum):
    """Status of a command or request."""

    NONE = "none"
    QUEUED = "queued"
    ACTIVE = "active"
    COMPLETED = "completed"
    OVERWRITTEN = "overwritten"
    PURGED = "purged"
    INTERRUPTED = "interrupted"
    REJECTED = "rejected"
    FORGOTTEN = "forgotten"  #: its status slot was reused
    HALTED = "halted"


class Reason(StrEnum):
    """Reason of a status."""

    NONE = "none"
    LATE = "late"
    EXCLUSIVE = "exclusive"
    INVALID = "invalid"
    LIMITS = "limits"
    DRIVER = "driver"
    FRESH_START = "fresh_start"
    DEAD_FRONTEND = "dead_frontend"
    SILENCE = "silence"
    STOPPED = "stopped"
    HALTED = "halted"
    FULL = "full"  #: too many batches of its frontend wait for later iterations
    READING = "reading"  #: the robot cannot be where it was read
    OLDER = "older"  #: the chunk answers an older observation than the one before it


class CommandEnd(NamedTuple):
    """The end of a command; of a request if it has no actuators."""

    iteration: int
    status: Status
    actuators: tuple[str, ...]
    reason: Reason = Reason.NONE
    text: str = ""  #: the reason in words; a journal does not have it


ModeWord: TypeAlias = Mode | Literal["queue", "overwrite"]
ProfileWord: TypeAlias = Profile | Literal["linear", "minimum_jerk", "as_sent"]
RowsWord: TypeAlias = Literal["smooth", "monotone", "linear", "hold"]
StartWord: TypeAlias = Start | Literal["desired", "observed"]
LateWord: TypeAlias = Literal["reject", "now"]
OnErrorWord: TypeAlias = Literal["purge", "continue"]
StaleWord: TypeAlias = Literal["hold", "purge", "halt", "stop"]
IdleWord: TypeAlias = Literal["hold", "follow"]
LifeWord: TypeAlias = Literal["starting", "running", "stopped", "failed", "superseded", "killed"]
