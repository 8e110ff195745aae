"""Connects learning code, real-time control and simulators through shared memory."""

import importlib
import sys
from typing import TYPE_CHECKING, Any

# imported first, so that exit handlers registered after `import o80` run before its own
from o80 import at_exit as _at_exit  # noqa: F401
from o80 import forks as _forks  # noqa: F401
from o80._core import Batch, Burst, Handle, Observation, Stream, version
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
    CopyFailed,
    DriverError,
    Error,
    InvalidArgument,
    LaneFull,
    Miss,
    MissingExtra,
    NoLane,
    NotBursting,
    NotCompleted,
    NotReached,
    ReadOnly,
    RecordingError,
    RequestRejected,
    RowOverwritten,
    SchemaMismatch,
    SegmentError,
    SegmentTaken,
    TimeoutError,
    UsedAfterFork,
)

if TYPE_CHECKING:
    from o80 import learning as learning
    from o80 import robots
    from o80.actuator import Actuator, Number
    from o80.backend import Backend, Running, StartAfresh
    from o80.burst_group import BurstGroup, burst
    from o80.chained_burst import ChainedBurst
    from o80.first import wait_for_first
    from o80.frontend import Frontend
    from o80.frontend_classes import register_frontend
    from o80.halts import Halt, halt
    from o80.history import History
    from o80.inline_group import Gather, Gathered, GroupBurst, GroupRequest, InlineGroup
    from o80.installation import prefix
    from o80.joining.align import Aligned, AlignedHistory, align
    from o80.joining.latency import Latency, latency
    from o80.journal import Journal, JournalCommand, JournalEntry
    from o80.limits import IntegralBounds, Limits
    from o80.playing.playback import Playback, play
    from o80.prepared_burst import PreparedBurst
    from o80.preview import Preview
    from o80.provenance import Provenance, ProvenanceFile
    from o80.record import Record
    from o80.recording.reader import RecordingFile
    from o80.recording.reader import open as open
    from o80.recording.recording import Recording
    from o80.replaying.replay import replay
    from o80.replaying.report import ReplayReport, RunReport
    from o80.running_request import RunningRequest
    from o80.segment_list import Segment, clean, segments
    from o80.states import States
    from o80.stopping import stop
    from o80.view import View
    from o80.words import Mode, Profile, Reason, Start, Status

# Imported when they are first used: they need NumPy, which takes most of the time of `import o80`,
# and commands such as `o80 list` do not need them.
_LAZY = {
    "Actuator": "o80.actuator",
    "Number": "o80.actuator",
    "Backend": "o80.backend",
    "Running": "o80.backend",
    "StartAfresh": "o80.backend",
    "BurstGroup": "o80.burst_group",
    "burst": "o80.burst_group",
    "wait_for_first": "o80.first",
    "Frontend": "o80.frontend",
    "register_frontend": "o80.frontend_classes",
    "Halt": "o80.halts",
    "halt": "o80.halts",
    "History": "o80.history",
    "Gather": "o80.inline_group",
    "Gathered": "o80.inline_group",
    "ChainedBurst": "o80.chained_burst",
    "GroupBurst": "o80.inline_group",
    "GroupRequest": "o80.inline_group",
    "InlineGroup": "o80.inline_group",
    "prefix": "o80.installation",
    "Aligned": "o80.joining.align",
    "AlignedHistory": "o80.joining.align",
    "align": "o80.joining.align",
    "Latency": "o80.joining.latency",
    "latency": "o80.joining.latency",
    "Journal": "o80.journal",
    "JournalCommand": "o80.journal",
    "JournalEntry": "o80.journal",
    "IntegralBounds": "o80.limits",
    "Limits": "o80.limits",
    "Playback": "o80.playing.playback",
    "play": "o80.playing.playback",
    "PreparedBurst": "o80.prepared_burst",
    "Preview": "o80.preview",
    "Provenance": "o80.provenance",
    "ProvenanceFile": "o80.provenance",
    "Record": "o80.record",
    "Recording": "o80.recording.recording",
    "RecordingFile": "o80.recording.reader",
    "open": "o80.recording.reader",
    "replay": "o80.replaying.replay",
    "ReplayReport": "o80.replaying.report",
    "RunReport": "o80.replaying.report",
    "RunningRequest": "o80.running_request",
    "Segment": "o80.segment_list",
    "clean": "o80.segment_list",
    "segments": "o80.segment_list",
    "States": "o80.states",
    "stop": "o80.stopping",
    "View": "o80.view",
    "Mode": "o80.words",
    "Profile": "o80.words",
    "Reason": "o80.words",
    "Start": "o80.words",
    "Status": "o80.words",
}

if not TYPE_CHECKING:  # otherwise a type checker would accept every name

    def __getattr__(name: str) -> Any:
        if name in ("learning", "robots"):
            return importlib.import_module(f"o80.{name}")
        if name not in _LAZY:
            raise AttributeError(f"module 'o80' has no attribute {name!r}")
        value = getattr(importlib.import_module(_LAZY[name]), name)
        globals()[name] = value
        return value

    def __dir__() -> list[str]:
        return sorted({*__all__, "learning", "open"})


__version__ = version()

# `open` is left out: `from o80 import *` must not replace the builtin. `learning` needs an extra.
__all__ = [
    "Actuator",
    "Aligned",
    "AlignedHistory",
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
    "ChainedBurst",
    "Closed",
    "ControlTaken",
    "CopyFailed",
    "DriverError",
    "Error",
    "Frontend",
    "Gather",
    "Gathered",
    "GroupBurst",
    "GroupRequest",
    "Halt",
    "Handle",
    "History",
    "InlineGroup",
    "IntegralBounds",
    "InvalidArgument",
    "Journal",
    "JournalCommand",
    "JournalEntry",
    "LaneFull",
    "Latency",
    "Limits",
    "Miss",
    "MissingExtra",
    "Mode",
    "NoLane",
    "NotBursting",
    "NotCompleted",
    "NotReached",
    "Number",
    "Observation",
    "Playback",
    "PreparedBurst",
    "Preview",
    "Profile",
    "Provenance",
    "ProvenanceFile",
    "ReadOnly",
    "Reason",
    "Record",
    "Recording",
    "RecordingError",
    "RecordingFile",
    "ReplayReport",
    "RequestRejected",
    "RowOverwritten",
    "RunReport",
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
    "View",
    "__version__",
    "align",
    "burst",
    "clean",
    "halt",
    "latency",
    "play",
    "prefix",
    "register_frontend",
    "replay",
    "robots",
    "segments",
    "stop",
    "version",
    "wait_for_first",
]

if "IPython" in sys.modules:
    from o80 import notebook as _notebook

    _notebook.enable()
