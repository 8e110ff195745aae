"""String enumerations of the API.

The aliases at the end are types of arguments: a member of an enumeration, or the string itself.
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
    MONOTONE = "monotone"  #: for rows: a curve through them that stays between them
    HOLD = "hold"  #: for rows: each is held from the iteration after the previous row
    SMOOTH = "smooth"  #: for rows: a curve through them, as samples of a smooth motion


class Start(StrEnum):
    """The state that a command starts from."""

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
    READING = "reading"  #: the robot cannot be at the position that was read
    OLDER = "older"  #: the chunk is based on an older observation than the previous chunk


class CommandEnd(NamedTuple):
    """The end of a command, or of a request (no actuators)."""

    iteration: int
    status: Status
    actuators: tuple[str, ...]
    reason: Reason = Reason.NONE
    text: str = ""  #: the reason as a sentence; empty in a journal


ModeWord: TypeAlias = Mode | Literal["queue", "overwrite"]
ProfileWord: TypeAlias = Profile | Literal["linear", "minimum_jerk", "as_sent"]
RowsWord: TypeAlias = Literal["smooth", "monotone", "linear", "hold"]
StartWord: TypeAlias = Start | Literal["desired", "observed"]
LateWord: TypeAlias = Literal["reject", "now"]
OnErrorWord: TypeAlias = Literal["purge", "continue"]
StaleWord: TypeAlias = Literal["hold", "purge", "halt", "stop"]
IdleWord: TypeAlias = Literal["hold", "follow"]
LifeWord: TypeAlias = Literal["starting", "running", "stopped", "failed", "superseded", "killed"]
