"""Sources to join by time: histories, each with the times of its rows on one common clock."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeAlias, cast

import numpy as np
from numpy.typing import NDArray

from o80.base.argument_checks import whole
from o80.base.errors import InvalidArgument
from o80.frontend.segments import boot_of
from o80.rows.history import History

if TYPE_CHECKING:
    from o80.frontend.frontend import Frontend
    from o80.recording.reader import RecordedSegment, RecordingFile
    from o80.recording.recorded_epoch import RecordedEpoch

    Source: TypeAlias = History | Frontend | RecordedEpoch | RecordedSegment
    Sources: TypeAlias = Mapping[str, Source] | Iterable[Frontend | RecordedSegment] | RecordingFile

CAPTURE_TIME = "capture_time"
"""Extended field of a device: when it captured the row, on the clock of the rows [ns]; 0: never."""
CAPTURE_ERROR = "capture_error"
"""Extended field of a device: possible error of its capture time [ns]."""
SAME_CLOCK = (
    5_000_000  # clocks of one boot differ by less, although the wall clock is adjusted [ns]
)


@dataclass(frozen=True)
class Timed:
    """A history, and the capture times of its rows."""

    history: History
    rows: NDArray[np.intp]  #: (N,) indices of captured rows, in the order of their capture
    times: NDArray[np.int64]  #: (N,) capture times, on the common clock [ns]


def timed(
    sources: "Sources",
    *,
    seconds: float | None = None,
    offsets: Mapping[str, int] | None = None,
) -> dict[str, Timed]:
    """Reads the histories of sources and puts their times on one clock.

    seconds: last seconds of each. offsets: see `align`. Raises InvalidArgument for other clocks.
    """
    given = named(sources)
    found = {name: opened(name, source, seconds) for name, source in given.items()}
    if unknown := sorted(set(offsets or {}) - set(found)):
        raise InvalidArgument(f"offsets: there is no {unknown[0]!r}; there are: {', '.join(found)}")
    offset_of: dict[str, int] = {}  # one for each boot: the wall clock may have been set in between
    for name, (history, offset) in found.items():
        boot = _boot_of(run_of(given[name]))
        if boot and offset is not None and history.schema["clock"] == "monotonic":
            found[name] = history, offset_of.setdefault(boot, offset)
    shifts = shifts_of(found)
    if offsets is not None:
        shifts = {name: whole(offsets.get(name, 0), f"offset of {name}") for name in found}
    elif shifts is None:
        clocks = ", ".join(
            f"{name}: {history.schema['clock']}" for name, (history, _) in found.items()
        )
        raise InvalidArgument(
            f"the rows have times of different clocks ({clocks}); give offsets={{name: ns}}, "
            "the nanoseconds to add to the times of each"
        )
    return {name: _on_clock(history, shifts[name]) for name, (history, _) in found.items()}


def named(sources: "Sources") -> "Mapping[str, Source]":
    if isinstance(sources, Mapping):
        return sources
    if hasattr(sources, "segments"):
        file = cast("RecordingFile", sources)
        return {name: file[name] for name in file}
    found: dict[str, Source] = {}
    for source in cast("Iterable[Source]", sources):
        name = getattr(source, "segment", None) or getattr(source, "name", None)
        if name is None:
            raise InvalidArgument(
                f"{source!r} has no name: give a mapping from names to sources instead of a list"
            )
        if name in found:
            raise InvalidArgument(f"two sources are named '{name}': give a mapping from names")
        found[name] = source
    return found


def run_of(source: Any) -> Any:
    """Returns a source as it is; for a recorded segment its only run.

    Raises InvalidArgument if a segment has several runs.
    """
    return getattr(source, "_run", source)


def _boot_of(run: Any) -> str:
    """Returns the id of the boot to whose clock a run's rows refer; empty: not known."""
    if hasattr(run, "provenance") and not hasattr(run, "wall_offset"):  # a frontend
        return boot_of(run)
    boot: str = getattr(run, "boot", "")
    return boot


def opened(name: str, source: Any, seconds: float | None) -> tuple[History, int | None]:
    """Reads the history of a source, and wall-clock minus row time [ns]; None: not known."""
    source = run_of(source)
    if isinstance(source, History):
        return source.select(seconds=seconds) if seconds is not None else source, None
    if not hasattr(source, "history"):
        raise InvalidArgument(
            f"{name} must be a Frontend, a History, or a run of a recording, got {source!r}"
        )
    offset = getattr(source, "wall_offset", None)  # of a recorded run
    if offset is None:
        offset = source.provenance.wall_clock_offset
    return source.history(seconds=seconds), int(offset)


def shifts_of(found: Mapping[str, tuple[History, int | None]]) -> dict[str, int] | None:
    """Returns shifts to add to the row times of each [ns]; None: their clocks are unrelated."""
    clocks = {history.schema["clock"] for history, _ in found.values()}
    if len(clocks) > 1:
        return None
    known = [offset for _, offset in found.values() if offset is not None]
    apart = max(known) - min(known) if known else 0
    if clocks != {"monotonic"} or apart < SAME_CLOCK:
        return dict.fromkeys(found, 0)
    if len(known) < len(found):
        return None
    return {name: offset or 0 for name, (_, offset) in found.items()}


def capture_times(history: History) -> NDArray[np.int64] | None:
    """Returns a device's capture times [ns], at most 0 for never; None: rows have no such field."""
    if CAPTURE_TIME not in (history.extended.keys() if len(history) else ()):
        return None
    return np.asarray(getattr(history.extended, CAPTURE_TIME)).astype(np.int64)


def _on_clock(history: History, shift: int) -> Timed:
    """Returns the captured rows in order of capture; of rows with equal times the newest."""
    times = capture_times(history)
    if times is not None:
        captured = np.flatnonzero(times > 0)
        order = captured[np.argsort(times[captured], kind="stable")]
        ordered = times[order]
        newest = np.append(ordered[1:] != ordered[:-1], True)[: len(ordered)]
        rows = order[newest]
    else:
        rows, times = np.arange(len(history)), history.time
    return Timed(history, rows, times[rows] + shift)
