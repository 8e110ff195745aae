"""Ctrl-C and SIGTERM, for programs that end in order."""

import signal
import time
from types import FrameType


class StopRequest:
    """Notes signals that request the end of the program, from its construction on."""

    def __init__(self) -> None:
        self.requested = False
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, self._request)

    def _request(self, _number: int, _frame: FrameType | None) -> None:
        self.requested = True

    def wait(self, seconds: float) -> None:
        """Waits for some seconds, or until the end is requested."""
        end = time.monotonic() + seconds
        while not self.requested and (left := end - time.monotonic()) > 0:
            time.sleep(min(left, 0.05))
