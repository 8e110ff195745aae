"""Real-time control, simulators and learning code in step, through shared memory."""

from o80 import robots
from o80._core import Batch, Burst, Handle, Observation, Stream, version
from o80.actuator import Actuator, Number
from o80.backend import Backend, Running, StartAfresh
from o80.burst_group import BurstGroup, burst
from o80.errors import (
    BackendFailed,
    BackendGone,
    BackendHalted,
    BackendKilled,
    BackendStopped,
    BackendSuperseded,
    Cancelled,
    Closed,
    ControlTaken,
    DriverError,
    Error,
    InvalidArgument,
    LaneFull,
    MissingExtra,
    NoLane,
    NotBursting,
    ReadOnly,
    RequestRejected,
    RowOverwritten,
    SchemaMismatch,
    SegmentError,
    SegmentTaken,
    TimeoutError,
    UsedAfterFork,
)
from o80.first import wait_for_first
from o80.frontend import Frontend
from o80.frontend_classes import register_frontend
from o80.halts import Halt, halt
from o80.history import History
from o80.installation import prefix
from o80.limits import Limits
from o80.prepared_burst import PreparedBurst
from o80.record import Record
from o80.running_request import RunningRequest
from o80.segment_list import Segment, clean, segments
from o80.states import States
from o80.stopping import stop
from o80.words import Mode, Profile, Reason, Start, Status

__version__ = version()

__all__ = [
    "Actuator",
    "Backend",
    "BackendFailed",
    "BackendGone",
    "BackendHalted",
    "BackendKilled",
    "BackendStopped",
    "BackendSuperseded",
    "Batch",
    "Burst",
    "BurstGroup",
    "Cancelled",
    "Closed",
    "ControlTaken",
    "DriverError",
    "Error",
    "Frontend",
    "Halt",
    "Handle",
    "History",
    "InvalidArgument",
    "LaneFull",
    "Limits",
    "MissingExtra",
    "Mode",
    "NoLane",
    "NotBursting",
    "Number",
    "Observation",
    "PreparedBurst",
    "Profile",
    "ReadOnly",
    "Reason",
    "Record",
    "RequestRejected",
    "RowOverwritten",
    "Running",
    "RunningRequest",
    "SchemaMismatch",
    "Segment",
    "SegmentError",
    "SegmentTaken",
    "Start",
    "StartAfresh",
    "States",
    "Status",
    "Stream",
    "TimeoutError",
    "UsedAfterFork",
    "__version__",
    "burst",
    "clean",
    "halt",
    "prefix",
    "register_frontend",
    "robots",
    "segments",
    "stop",
    "version",
    "wait_for_first",
]
