"""Requests snapshots from simulations while they are recorded: a replay can begin at each."""

import math
import warnings
from time import monotonic

import o80._core as _core
from o80.base.errors import BackendGone, Error, InvalidArgument
from o80.base.words import Status
from o80.frontend.frontend import Frontend
from o80.rows.journal import ENDS

SLOT = 7  #: slot of the recorder: the last one that simulations have


def interval(seconds: float) -> float:
    """Checks the time between two snapshots [s]. Raises InvalidArgument unless positive."""
    if not 0 < seconds < math.inf:
        raise InvalidArgument(f"snapshots must be a positive number of seconds, got {seconds:g}")
    return seconds


class SnapshotRequests:
    """Sends `snapshot` to a segment periodically, without waiting for the result."""

    def __init__(self, seconds: float) -> None:
        self._seconds = seconds
        self._at = monotonic()  # when the next one is due
        self._sent: tuple[Frontend, _core.Batch] | None = None
        self._said = False

    def poll(self, reader: Frontend) -> None:
        """Sends a request if it is due and nothing moves: a replay can begin only at rest."""
        if self._sent is not None:
            self._look(*self._sent)
        elif monotonic() >= self._at and reader.alive:
            if "snapshot" not in reader.requests:
                self._say(f"'{reader.segment}' serves no request snapshot")
            elif not reader.latest().active.any():
                self._send(reader)
            elif monotonic() >= self._at + self._seconds:
                self._say(f"'{reader.segment}' moved whenever one was due")

    def close(self) -> None:
        """Releases the lane."""
        if self._sent is not None:
            self._sent[0].close()
        self._sent = None

    def _send(self, reader: Frontend) -> None:
        sender = None
        try:
            sender = Frontend(reader.segment, timeout=0)
            if sender.epoch == reader.epoch:
                sender.add_request("snapshot", slot=SLOT)
                self._sent = sender, sender.pulse()
        except Error as error:
            self._say(str(error))
        if sender is not None and self._sent is None:
            sender.close()

    def _look(self, sender: Frontend, batch: _core.Batch) -> None:
        handle = batch.handles[0]
        try:
            if sender.alive and handle.status not in ENDS:
                return
            if sender.alive and handle.status != Status.COMPLETED:
                self._say(f"'{sender.segment}' refused it: {handle.text}")
        except BackendGone:
            pass
        self.close()
        self._at = monotonic() + self._seconds

    def _say(self, why: str) -> None:
        """Warns once that no snapshot is recorded."""
        self._at = monotonic() + self._seconds
        if not self._said:
            self._said = True
            warnings.warn(f"no snapshot is recorded: {why}", RuntimeWarning, stacklevel=2)
