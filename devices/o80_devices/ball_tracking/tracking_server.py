"""Driver for a separate ball-tracking server that publishes over ZeroMQ."""

from __future__ import annotations

import time
from typing import Any, ClassVar

import numpy as np

import o80
from o80.base.extras import needed
from o80.drivers import Reading
from o80.errors import DriverError
from o80_devices.ball_tracking.ball_row import EXTENDED, UNITS
from o80_devices.ball_tracking.server_messages import Options, ServerReason, ServerTrack

FIELDS = (
    *("capture_time", "capture_error", "stamp", "ball"),
    *("position", "velocity", "spin", "error", "measured"),
)
"""Values of a row that a row of the tracker with cameras has, too."""


class TrackingServer:
    """Reads the newest message for each row; a row without a new one carries the reason."""

    Config = Options
    frequency = 200.0
    extended: ClassVar = {name: EXTENDED[name] for name in FIELDS} | {
        "epoch": np.int64,
        "reason": ServerReason,
    }
    units: ClassVar = {name: UNITS[name] for name in FIELDS if name in UNITS}

    def __init__(self, config: Options) -> None:
        for name in ("noise", "timeout", "max_age", "forget"):
            if not 1e-9 <= (value := getattr(config, name)) <= 1e6:
                raise o80.InvalidArgument(f"{name} must be from 1e-09 to 1e+06, got {value:g}")
        if not 0.0 <= config.latency < 1e6:
            raise o80.InvalidArgument(f"latency must be at least 0 s, got {config.latency:g}")
        for name in ("translation", "rotation"):
            if not np.isfinite(getattr(config, name)).all():
                raise o80.InvalidArgument(
                    f"{name} must be three finite numbers, got {getattr(config, name)}"
                )
        self._config = config
        self._track = ServerTrack(config)
        self._socket: Any = None

    def start(self) -> None:
        self._zmq = zmq = needed("zmq", "zeromq", "a tracking server", package="o80-devices")
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
        capture = seen.capture
        reading.extended = seen.ball.fields() | {
            "capture_error": 0 if capture is None else capture.error,
            "epoch": 0 if capture is None else capture.epoch,
            "stamp": seen.stamp,
            "reason": seen.reason,
        }

    def stop(self) -> None:
        if self._socket is not None:
            self._socket.close(linger=0)
            self._context.destroy(linger=0)
            self._socket = None
