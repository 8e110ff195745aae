"""Driver for a separate ball-tracking server that publishes over ZeroMQ."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

import o80
from o80.drivers import Reading, option
from o80.errors import DriverError
from o80_devices import zeromq
from o80_devices.ball_tracking.server_messages import Place, Seen, ServerReason, ServerTrack


@dataclass
class Options:
    """Options of the client of a tracking server."""

    address: str = option("tcp://127.0.0.1:7660", "where the server publishes")
    translation: tuple[float, float, float] = option(
        (0.0, 0.0, 0.0), "of the tracker's frame in the world", "m"
    )
    rotation: tuple[float, float, float] = option(
        (0.0, 0.0, 0.0), "of the tracker's frame: roll, pitch, yaw", "rad"
    )
    noise: float = option(0.003, "standard deviation of a place", "m")
    latency: float = option(0.0, "from the image to the earliest arrival of its message", "s")
    timeout: float = option(0.05, "without a message, after which the server is silent", "s")
    max_age: float = option(0.1, "older messages are not used", "s")
    forget: float = option(0.3, "a ball not seen for so long is another one", "s")


class TrackingServer:
    """Reads the newest message for each row; a row without a new one carries the reason."""

    Config = Options
    frequency = 200.0
    extended: ClassVar = {
        "capture_time": np.int64,
        "capture_error": np.int64,
        "epoch": np.int64,
        "stamp": np.int64,
        "reason": ServerReason,
        "ball": np.int64,
        "position": (np.float64, (3,)),
        "velocity": (np.float64, (3,)),
        "spin": (np.float64, (3,)),
        "error": np.float64,
        "measured": (np.float64, (3,)),
    }
    units: ClassVar = {
        "capture_time": "ns",
        "capture_error": "ns",
        "stamp": "ns",
        "position": "m",
        "velocity": "m/s",
        "spin": "rad/s",
        "error": "m",
        "measured": "m",
    }

    def __init__(self, config: Options) -> None:
        for name in ("noise", "timeout", "max_age", "forget"):
            if not 0.0 < getattr(config, name) < 1e6:
                raise o80.InvalidArgument(f"{name} must be positive, got {getattr(config, name):g}")
        if not 0.0 <= config.latency < 1e6:
            raise o80.InvalidArgument(f"latency must be at least 0 s, got {config.latency:g}")
        for name in ("translation", "rotation"):
            if not np.isfinite(getattr(config, name)).all():
                raise o80.InvalidArgument(
                    f"{name} must be three finite numbers, got {getattr(config, name)}"
                )
        self._config = config
        self._track = ServerTrack(
            Place(config.translation, config.rotation),
            noise=config.noise,
            latency=config.latency,
            timeout=config.timeout,
            max_age=config.max_age,
            forget=config.forget,
        )
        self._socket: Any = None

    def start(self) -> None:
        self._zmq = zmq = zeromq.required()
        self._context = zmq.Context()
        self._socket = self._context.socket(zmq.SUB)
        self._socket.setsockopt(zmq.CONFLATE, 1)  # a queue of one, the newest message
        self._socket.setsockopt(zmq.LINGER, 0)
        self._socket.setsockopt(zmq.RECONNECT_IVL, 50)  # [ms]
        self._socket.setsockopt(zmq.SUBSCRIBE, b"")
        try:
            self._socket.connect(self._config.address)
        except zmq.ZMQError as error:
            self.stop()
            raise DriverError(
                f"address '{self._config.address}' cannot be used ({error}): give one such as "
                "tcp://192.168.0.5:7660"
            ) from None

    def read(self, reading: Reading) -> None:
        try:
            content = self._socket.recv(self._zmq.NOBLOCK)
        except self._zmq.Again:
            seen = self._track.silent(time.monotonic_ns())
        else:
            seen = self._track.take(content, time.monotonic_ns())
        fill(reading, seen)

    def stop(self) -> None:
        if self._socket is not None:
            self._socket.close(linger=0)
            self._context.destroy(linger=0)
            self._socket = None


def fill(reading: Reading, seen: Seen) -> None:
    """Writes the row."""
    row, ball, capture = reading.extended, seen.ball, seen.capture
    row["capture_time"] = ball.time if ball.seen else 0
    row["capture_error"] = 0 if capture is None else capture.error
    row["epoch"] = 0 if capture is None else capture.epoch
    row["stamp"] = seen.stamp
    row["reason"] = seen.reason
    row["ball"] = ball.ball
    for name in ("position", "velocity", "spin", "measured"):
        row[name] = getattr(ball, name)
    row["error"] = ball.error if ball.seen else np.nan
