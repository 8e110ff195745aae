"""Publishes the balls of the fake launcher like a tracking server."""

from __future__ import annotations

import time
from threading import Event, Lock, Thread

import numpy as np

from o80.base.arrays import FloatArray
from o80_devices.ball_launcher.launch_model import Launch
from o80_devices.ball_tracking.server_messages import Message
from o80_devices.cameras.flight import Flight, FlightLaw, Table
from o80_devices.fakes.tracking_server import RATE, FakeTrackingServer

SECOND = 1_000_000_000  # [ns]
SEEN_FOR = 3.0
"""Time after a launch for which a ball is tracked [s]."""


class LaunchedBalls:
    """Simulates the flight and bounces of the last launched ball."""

    def __init__(
        self,
        position: tuple[float, float, float],
        yaw: float,
        *,
        noise: float = 0.0,
        seed: int = 0,
    ) -> None:
        """position, yaw: pose of the launcher in the world [m], [rad]. noise: of a place [m]."""
        self._position, self._yaw = position, yaw
        self._law = FlightLaw(Flight(), Table())
        self._noise, self._rng = noise, np.random.default_rng(seed)
        self._ball: FloatArray | None = None
        self._launched = 0  # [ns]

    def launched(self, ball: Launch, now: int) -> None:
        placed = ball.placed(self._position, self._yaw)
        self._ball = np.concatenate([placed.position, placed.velocity, placed.spin])
        self._launched = now

    def message(self, now: int) -> Message:
        """Returns the tracker's message at a time [ns], not before the last launch."""
        since = (now - self._launched) / SECOND
        if self._ball is None or since > SEEN_FOR:
            return Message(now, None)
        place = self._law.advance(self._ball, since)[0][:3]
        if place[2] < 0.0:  # it has fallen to the floor
            return Message(now, None)
        return Message(now, place + self._noise * self._rng.standard_normal(3))


class TrackedLauncher:
    """Publishes the balls in a thread. A context manager."""

    def __init__(self, address: str, balls: LaunchedBalls) -> None:
        self._balls = balls
        self._server = FakeTrackingServer(address)
        self._lock = Lock()
        self._stopping = Event()
        self._thread = Thread(target=self._run, daemon=True)

    @property
    def address(self) -> str:
        return self._server.address

    def launched(self, ball: Launch) -> None:
        with self._lock:
            self._balls.launched(ball, time.monotonic_ns())

    def __enter__(self) -> TrackedLauncher:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stopping.set()
        self._thread.join()
        self._server.close()

    def _run(self) -> None:
        while not self._stopping.wait(1 / RATE):
            with self._lock:
                message = self._balls.message(time.monotonic_ns())
            self._server.publish(message)
