"""Receives frames over a connection, and reopens the connection after each failure."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from dataclasses import replace
from threading import Condition, Event, Thread
from typing import Protocol

from o80_devices.motion_capture.frame import Frame
from o80_devices.motion_capture.sensor import SECOND, Reason
from o80_devices.trouble import Trouble

MAX_WAITING = 4  # queued frames; older ones are dropped
WAIT = 0.05  # timeout of one wait for a frame; then the stop flag is checked [s]
SILENCE = 1.0  # silence after which a connection is reopened: a pulled cable does not close it [s]
RETRY = 0.2  # wait after a failure, doubled after each further one without a frame [s]
LONGEST_RETRY = 5.0  # [s]
STOPPING = 2.0  # timeout of the thread's end [s]


class Connection(Protocol):
    @property
    def patience(self) -> float:
        """Longest time without a frame, since the last one or since the connection began [s]."""

    def receive(self, timeout: float) -> Frame | None:
        """Returns the next frame, or None. Raises OSError or ValueError if the connection fails."""

    def close(self) -> None: ...


class FrameStream:
    """Receives frames in a thread, which stamps each arrival.

    Writer:  the thread.
    Reader:  the loop of the driver, which never waits for the network.
    """

    def __init__(
        self, connect: Callable[[], Connection], device: str, longest_retry: float = RETRY
    ) -> None:
        """connect: opens a connection within about a second, or raises OSError or ValueError.

        device: name in messages. longest_retry: limit of the time between attempts [s].
        """
        self._connect = connect
        self._frames: deque[Frame] = deque(maxlen=MAX_WAITING)
        self._arrived = Condition()
        self._stopping = Event()
        self._thread: Thread | None = None
        self.reason = Reason.CONNECTING
        self.trouble = Trouble(device)
        self._longest_retry = longest_retry
        self._retry = RETRY  # [s]
        self.connections = 0

    def start(self) -> None:
        self._stopping.clear()
        self._thread = Thread(target=self._run, name="motion capture", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        self._stopping.set()
        if self._thread is not None:
            self._thread.join(STOPPING)
            self._thread = None

    def taken(self, now: int) -> Frame | None:
        with self._arrived:
            return self._frames.popleft() if self._frames else None

    def next(self, deadline: int) -> Frame | None:
        with self._arrived:
            self._arrived.wait_for(lambda: self._frames, (deadline - time.monotonic_ns()) / SECOND)
            return self._frames.popleft() if self._frames else None

    # ------------------------------------------------------------------ the thread

    def _run(self) -> None:
        while not self._stopping.is_set():
            try:
                connection = self._connect()
                self.connections += 1
                try:
                    self._receive_from(connection)
                finally:
                    connection.close()
            except Exception as error:
                # any error, for example of a damaged message, is answered by a new connection
                if not self._stopping.is_set():
                    self.trouble.tell(str(error) or type(error).__name__)
            self.reason = Reason.DISCONNECTED
            self._stopping.wait(self._retry)
            self._retry = min(2 * self._retry, self._longest_retry)

    def _receive_from(self, connection: Connection) -> None:
        self.reason = Reason.SEEN
        last = time.monotonic()
        while not self._stopping.is_set():
            frame = connection.receive(WAIT)
            if frame is not None:
                last = time.monotonic()
                self._retry = RETRY
                self.trouble.is_over()
                with self._arrived:
                    self._frames.append(replace(frame, connection=self.connections))
                    self._arrived.notify()
            elif time.monotonic() - last > (patience := connection.patience):
                raise TimeoutError(f"connected, but no frame for {patience:g} s")
