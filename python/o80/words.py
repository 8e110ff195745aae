"""Words that are one of a few: strings, with a name for each.

The aliases at the end are what arguments accept: a member of the enumeration, or the string itself.
"""

from enum import StrEnum
from typing import Literal, TypeAlias


class Mode(StrEnum):
    """Where a command goes."""

    QUEUE = "queue"  #: after what is there
    OVERWRITE = "overwrite"  #: instead of what is there


class Profile(StrEnum):
    """How a command moves between two states."""

    LINEAR = "linear"
    MINIMUM_JERK = "minimum_jerk"


class Start(StrEnum):
    """The state a command starts from."""

    DESIRED = "desired"
    OBSERVED = "observed"


class Status(StrEnum):
    """What became of a command or a request."""

    NONE = "none"
    QUEUED = "queued"
    ACTIVE = "active"
    COMPLETED = "completed"
    LIMITED = "limited"  #: completed, but clamped at its last iteration
    OVERWRITTEN = "overwritten"
    PURGED = "purged"
    INTERRUPTED = "interrupted"
    REJECTED = "rejected"
    FORGOTTEN = "forgotten"  #: asked for too late
    HALTED = "halted"


class Reason(StrEnum):
    """Why a status is what it is."""

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
    FULL = "full"  #: more batches wait for later iterations than one frontend may have


ModeWord: TypeAlias = Mode | Literal["queue", "overwrite"]
ProfileWord: TypeAlias = Profile | Literal["linear", "minimum_jerk"]
StartWord: TypeAlias = Start | Literal["desired", "observed"]
OnLimitWord: TypeAlias = Literal["end", "go_on"]
LateWord: TypeAlias = Literal["reject", "now"]
OnErrorWord: TypeAlias = Literal["purge", "continue"]
StaleWord: TypeAlias = Literal["hold", "purge", "halt", "stop"]
IdleWord: TypeAlias = Literal["hold", "follow"]
LifeWord: TypeAlias = Literal["starting", "running", "stopped", "failed", "superseded", "killed"]
