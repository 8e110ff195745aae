"""Publishes the rows of one track as a segment in shared memory."""

import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

import o80._core as _core
from o80.base.errors import InvalidArgument, RecordingError
from o80.playing.track import Part, Track
from o80.recording.journal_channel import Entries
from o80.rows.layout import with_padding
from o80.rows.provenance import Provenance

KEPT = 64 << 20  # most bytes of the rows that a segment keeps by default
END = 2**62  # an iteration later than any
NO_TIME = np.empty(0, np.int64)


class Player:
    """Publishes the parts of a track; each run of its robot is a run of the segment.

    One thread uses it; any thread may call `stop`.
    """

    def __init__(
        self,
        track: Track,
        name: str,
        *,
        bursting: bool,
        real_time: bool,
        history: int | None,
        permission: int,
    ) -> None:
        """real_time: rows of robots in real time get the times at which they are published.

        Raises SegmentTaken for a taken name, InvalidArgument for a wrong one, SegmentError.
        """
        self.track = track
        self.name = name
        self.rows = 0  #: published so far
        self._bursting, self._real_time = bursting, real_time
        self._history, self._permission = history, permission
        self._lock = threading.Lock()
        self._stopped = False
        self._run = 0
        self._segment: _core.PlayedSegment | None = None
        self._journal: Iterator[Entries] = iter(())
        self._journal_until = END  # iteration of the last entry that was added
        self.begin(0)

    def begin(self, run: int) -> None:
        """Ends the previous run and creates the segment of this one."""
        self.end()
        with self._lock:
            if self._stopped:
                return
            epoch = self.track.epochs[run]
            self._run = run
            self._segment = _core.PlayedSegment(
                self.name,
                epoch.description.table(),
                self._provenance(run),
                self._bursting,
                not self._has_clock(run),
                self._history or max(1, min(epoch.rows, KEPT // epoch.schema["row"]["size"])),
                epoch.has_journal,
                self._permission,
            )
            self._journal = epoch.journal_parts()
            self._journal_until = -1

    def publish(self, part: Part, due: NDArray[np.int64] | None) -> bool:
        """Publishes rows when they are due [ns] (None: at once). False after `stop`."""
        rows = part.rows
        if due is not None and self._has_clock(part.run):
            rows = with_padding(rows).copy().view(rows.dtype)
            rows["time"] += due[0] - rows["time"][0]
        segment = self._of(part)
        if segment is None:
            return False
        done = segment.publish(_bytes(rows), NO_TIME if due is None else due)
        self.rows += done
        return done == len(rows)

    def serve(self, part: Part) -> bool:
        """Publishes rows as frontends request them. False after `stop`."""
        segment = self._of(part)
        if segment is None:
            return False
        done = segment.serve(_bytes(part.rows))
        self.rows += done
        return done == len(part.rows)

    def end_at_burst(self) -> None:
        """Ends a run played by bursts once a frontend requests a row after its last one."""
        if self._segment is not None:
            self._segment.wait_for_burst()
        self.end()

    def end(self) -> None:
        """Ends the run and reports to frontends that no row follows."""
        with self._lock:
            if self._segment is not None:
                self._segment.end()
                self._segment = None

    def stop(self) -> None:
        """Makes `publish` and `serve` return within 50 ms."""
        with self._lock:
            self._stopped = True
            if self._segment is not None:
                self._segment.ask_to_stop()

    def _of(self, part: Part) -> _core.PlayedSegment | None:
        """Returns the segment of the part's run, with the part's journal; None after `stop`."""
        if self._segment is None or part.run != self._run:
            self.begin(part.run)
        # one iteration more, because a backend's end belongs to the iteration after its last row
        last = int(part.rows["iteration"][-1]) + 1
        while self._segment is not None and self._journal_until <= last:
            entries = next(self._journal, None)
            self._journal_until = END if entries is None else self._add(entries)
        return self._segment

    def _add(self, entries: Entries) -> int:
        """Adds entries, returns the last iteration. Raises RecordingError if they are invalid."""
        assert self._segment is not None
        try:
            return self._segment.add_journal(entries.content, entries.codec)
        except InvalidArgument as error:
            raise RecordingError(
                f"the journal of '{self.name}' cannot be played: {error}"
            ) from error

    def _provenance(self, run: int) -> Provenance:
        """Returns the recorded provenance with the clock offset of the rows as they are played."""
        epoch = self.track.epochs[run]
        offset = epoch.wall_offset
        if self._has_clock(run):
            offset = time.time_ns() - time.monotonic_ns()
        return replace(epoch.provenance, wall_clock_offset=offset)

    def _has_clock(self, run: int) -> bool:
        """Whether row times are on the monotonic clock of this computer."""
        clock: str = self.track.epochs[run].schema["clock"]
        return self._real_time and clock == "monotonic"


def _bytes(rows: NDArray[Any]) -> NDArray[np.uint8]:
    return np.ascontiguousarray(rows).view(np.uint8)
