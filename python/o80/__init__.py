"""Connects learning code, real-time control and simulators through shared memory."""

import importlib
import sys
from typing import TYPE_CHECKING, Any

from o80._core import Batch as Batch
from o80._core import Burst as Burst
from o80._core import DecisionLatency as DecisionLatency
from o80._core import Handle as Handle
from o80._core import Observation as Observation
from o80._core import Seen as Seen
from o80._core import Stream as Stream
from o80._core import version as version

# imported first, so that exit handlers registered after `import o80` run before its own
from o80.base import lifecycle as _lifecycle  # noqa: F401
from o80.base.errors import BackendFailed as BackendFailed
from o80.base.errors import BackendGone as BackendGone
from o80.base.errors import BackendHalted as BackendHalted
from o80.base.errors import BackendKilled as BackendKilled
from o80.base.errors import BackendStopped as BackendStopped
from o80.base.errors import BackendSuperseded as BackendSuperseded
from o80.base.errors import Cancelled as Cancelled
from o80.base.errors import Closed as Closed
from o80.base.errors import ControlTaken as ControlTaken
from o80.base.errors import CopyFailed as CopyFailed
from o80.base.errors import DriverError as DriverError
from o80.base.errors import Error as Error
from o80.base.errors import InvalidArgument as InvalidArgument
from o80.base.errors import LaneFull as LaneFull
from o80.base.errors import Miss as Miss
from o80.base.errors import MissingExtra as MissingExtra
from o80.base.errors import NoLane as NoLane
from o80.base.errors import NotBursting as NotBursting
from o80.base.errors import NotCompleted as NotCompleted
from o80.base.errors import NotReached as NotReached
from o80.base.errors import ReadOnly as ReadOnly
from o80.base.errors import RecordingError as RecordingError
from o80.base.errors import RequestRejected as RequestRejected
from o80.base.errors import RowOverwritten as RowOverwritten
from o80.base.errors import SchemaMismatch as SchemaMismatch
from o80.base.errors import SegmentError as SegmentError
from o80.base.errors import SegmentTaken as SegmentTaken
from o80.base.errors import TimeoutError as TimeoutError
from o80.base.errors import UsedAfterFork as UsedAfterFork

__version__ = "0.1.0"

if version() != __version__:
    raise ImportError(
        f"the Python files of o80 have version {__version__}, its compiled module {version()}: "
        "install o80 again, pip install --force-reinstall --no-deps o80"
    )

if TYPE_CHECKING:
    from o80 import errors as errors
    from o80 import learning as learning
    from o80 import robots as robots
    from o80.base.installation import prefix as prefix
    from o80.base.words import Mode as Mode
    from o80.base.words import Profile as Profile
    from o80.base.words import Reason as Reason
    from o80.base.words import Start as Start
    from o80.base.words import Status as Status
    from o80.drivers.backend import Backend as Backend
    from o80.drivers.backend import Running as Running
    from o80.drivers.backend import StartAfresh as StartAfresh
    from o80.frontend.chunk_parts import SentChunk as SentChunk
    from o80.frontend.chunks import Chunks as Chunks
    from o80.frontend.frontend import Frontend as Frontend
    from o80.frontend.frontend import register_frontend as register_frontend
    from o80.frontend.frontend import wait_for_first as wait_for_first
    from o80.frontend.prepared_burst import PreparedBurst as PreparedBurst
    from o80.frontend.reader import Journal as Journal
    from o80.frontend.results import Halt as Halt
    from o80.frontend.results import Preview as Preview
    from o80.frontend.results import RunningRequest as RunningRequest
    from o80.frontend.segments import Segment as Segment
    from o80.frontend.segments import clean as clean
    from o80.frontend.segments import segments as segments
    from o80.frontend.stopping import halt as halt
    from o80.frontend.stopping import stop as stop
    from o80.groups.burst_set import BurstGroup as BurstGroup
    from o80.groups.burst_set import burst as burst
    from o80.groups.gather import Gather as Gather
    from o80.groups.gather import Gathered as Gathered
    from o80.groups.group_burst import GroupBurst as GroupBurst
    from o80.groups.group_burst import GroupRequest as GroupRequest
    from o80.groups.inline_group import InlineGroup as InlineGroup
    from o80.joining.align import Aligned as Aligned
    from o80.joining.align import AlignedHistory as AlignedHistory
    from o80.joining.align import align as align
    from o80.joining.latency import Latency as Latency
    from o80.joining.latency import latency as latency
    from o80.joining.teleoperation import Joint as Joint
    from o80.joining.teleoperation import Teleoperation as Teleoperation
    from o80.playing.playback import Playback as Playback
    from o80.playing.playback import play as play
    from o80.recording.catalogue import FoundRecording as FoundRecording
    from o80.recording.catalogue import FoundRun as FoundRun
    from o80.recording.catalogue import recordings as recordings
    from o80.recording.reader import RecordingFile as RecordingFile
    from o80.recording.reader import open as open
    from o80.recording.recording import Recording as Recording
    from o80.replaying.replay import replay as replay
    from o80.replaying.report import ReplayReport as ReplayReport
    from o80.replaying.report import RunReport as RunReport
    from o80.robots.robot import face as face
    from o80.rows.actuators import Actuator as Actuator
    from o80.rows.actuators import IntegralBounds as IntegralBounds
    from o80.rows.actuators import Limits as Limits
    from o80.rows.actuators import Number as Number
    from o80.rows.history import History as History
    from o80.rows.journal import JournalCommand as JournalCommand
    from o80.rows.journal import JournalEntry as JournalEntry
    from o80.rows.provenance import Provenance as Provenance
    from o80.rows.provenance import ProvenanceFile as ProvenanceFile
    from o80.rows.record import Record as Record
    from o80.rows.record import States as States
    from o80.view.pictures import Pictures as Pictures
    from o80.view.pictures import write_film as write_film
    from o80.view.view import View as View
else:  # a type checker that read this would accept every name
    # Imported when they are first used: they need NumPy, which takes most of the time of
    # `import o80`, and commands such as `o80 list` do not need them.
    _LAZY = {
        "rows.actuators": "Actuator IntegralBounds Limits Number",
        "drivers.backend": "Backend Running StartAfresh",
        "groups.burst_set": "BurstGroup burst",
        "frontend.frontend": "Frontend register_frontend wait_for_first",
        "frontend.reader": "Journal",
        "frontend.results": "Halt Preview RunningRequest",
        "rows.history": "History",
        "groups.gather": "Gather Gathered",
        "groups.inline_group": "InlineGroup",
        "base.installation": "prefix",
        "joining.align": "Aligned AlignedHistory align",
        "joining.latency": "Latency latency",
        "view.pictures": "Pictures write_film",
        "joining.teleoperation": "Joint Teleoperation",
        "rows.journal": "JournalCommand JournalEntry",
        "playing.playback": "Playback play",
        "frontend.prepared_burst": "PreparedBurst",
        "frontend.chunk_parts": "SentChunk",
        "frontend.chunks": "Chunks",
        "groups.group_burst": "GroupBurst GroupRequest",
        "rows.provenance": "Provenance ProvenanceFile",
        "rows.record": "Record States",
        "recording.catalogue": "FoundRecording FoundRun recordings",
        "recording.reader": "RecordingFile open",
        "recording.recording": "Recording",
        "replaying.replay": "replay",
        "robots.robot": "face",
        "replaying.report": "ReplayReport RunReport",
        "frontend.segments": "Segment clean segments",
        "frontend.stopping": "halt stop",
        "view.view": "View",
        "base.words": "Mode Profile Reason Start Status",
    }
    _MODULES = {name: f"o80.{at}" for at, names in _LAZY.items() for name in names.split()}
    _LOADED = [
        name
        for name, value in globals().items()
        if getattr(value, "__module__", "").startswith("o80.")
    ]
    # `from o80 import *` must not replace the builtin `open`. `learning` needs an extra.
    __all__ = sorted({"__version__", "errors", "robots", *_LOADED, *_MODULES} - {"open"})

    def __getattr__(name: str) -> Any:
        if name in ("errors", "learning", "robots"):
            return importlib.import_module(f"o80.{name}")
        if name not in _MODULES:
            raise AttributeError(f"module 'o80' has no attribute {name!r}")
        value = getattr(importlib.import_module(_MODULES[name]), name)
        globals()[name] = value
        return value

    def __dir__() -> list[str]:
        return sorted({*__all__, "learning", "open"})


if "IPython" in sys.modules:
    from o80 import notebook as _notebook

    _notebook.enable()
