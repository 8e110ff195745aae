"""Words that are one of a few: strings, with a name for each."""

from enum import StrEnum


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
