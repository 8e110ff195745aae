"""Converts the messages of a tracking server to a tracked ball: JSON, clock, frame, flight.

A message is `{"time": <int, ns>, "obs": [x, y, z]}` in metres in the frame of the tracker, or
`"obs": null` without a ball.
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from enum import IntEnum
from typing import Any

import numpy as np

from o80.base.arrays import FloatArray
from o80.base.finite import json_text
from o80.drivers import option
from o80_devices.ball_tracking.ball_row import Reason
from o80_devices.ball_tracking.flight_track import FlightTrack, Tracked
from o80_devices.cameras.rig import four_cameras
from o80_devices.clock import Capture, ClockMap

SECOND = 1_000_000_000  # [ns]
LARGEST_STAMP = 2**62
LARGEST_MESSAGE = 1 << 16
"""Larger messages are of another publisher, and are not parsed [bytes]."""
FARTHEST = 1e3
"""Limit of a coordinate; larger ones are invalid [m]."""


class ServerReason(IntEnum):
    """Reason why a row has no ball."""

    seen = 0
    """The row has the ball of a new message."""
    no_new_message = 1
    """No message since the last row; the next one is not late yet."""
    silent = 2
    """No message for longer than `timeout`: the server, the network or the cable."""
    not_seen = 3
    """The server says that it sees no ball."""
    unexpected = 4
    """The place does not continue the flight; a second one means a hit or another ball."""
    late = 5
    """The message is older than `max_age`."""
    invalid = 6
    """The message could not be understood."""


@dataclass(frozen=True)
class Message:
    """Message of the server about one frame."""

    stamp: int
    """Time on the server's clock [ns]."""
    place: FloatArray | None
    """(3,) in the frame of the tracker [m]."""

    @classmethod
    def decoded(cls, content: bytes) -> Message:
        """Decodes a message. Raises ValueError if the bytes are no message."""
        if len(content) > LARGEST_MESSAGE:
            raise ValueError(f"a message of {len(content)} bytes is not from a tracking server")
        try:
            read = json.loads(content)
            stamp, place = read["time"], read["obs"]
        except (ValueError, KeyError, TypeError, RecursionError) as error:
            raise ValueError(f"not a message from a tracking server: {error}") from None
        if type(stamp) is not int or abs(stamp) > LARGEST_STAMP:
            raise ValueError(f"`time` must be an integer in nanoseconds, got {stamp!r}")
        if place is None:
            return cls(stamp, None)
        if not (
            isinstance(place, list)
            and len(place) == 3
            and all(_is_length(value) for value in place)
        ):
            raise ValueError(f"`obs` must be three numbers in metres or null, got {place!r}")
        return cls(stamp, np.array(place, dtype=np.float64))

    def encoded(self) -> bytes:
        place = None if self.place is None else [float(value) for value in self.place]
        return json_text({"time": self.stamp, "obs": place}).encode()


def _is_length(value: Any) -> bool:
    return type(value) in (int, float) and abs(value) < FARTHEST  # also false for NaN


@dataclass(frozen=True)
class Seen:
    """Values of a row: the ball, or the reason why there is none."""

    reason: ServerReason
    ball: Tracked
    capture: Capture | None = None
    stamp: int = 0


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


def turned(rotation: tuple[float, float, float]) -> FloatArray:
    """Rotation matrix (3, 3) of turns about the axes x, y and z of the world, in this order."""
    matrix = np.eye(3)
    for axis, angle in enumerate(rotation):
        one, other = (axis + 1) % 3, (axis + 2) % 3
        turn = np.eye(3)
        turn[one, one] = turn[other, other] = math.cos(angle)
        turn[other, one] = math.sin(angle)
        turn[one, other] = -turn[other, one]
        matrix = turn @ matrix
    return matrix


class ServerTrack:
    """Tracks the ball from messages; the caller passes the time."""

    def __init__(self, options: Options) -> None:
        self._rotation = turned(options.rotation)
        self._translation = np.array(options.translation)
        self._covariance = options.noise**2 * np.eye(3)
        self._clock = ClockMap(latency=options.latency)
        self._timeout = round(options.timeout * SECOND)
        self._max_age = round(options.max_age * SECOND)
        self._flight = FlightTrack(four_cameras().law(), options.forget)
        self._newest: int | None = None  # arrival [ns]

    def silent(self, now: int) -> Seen:
        """Returns the row for a time [ns] without a new message."""
        gone = self._newest is None or now - self._newest > self._timeout
        reason = ServerReason.silent if gone else ServerReason.no_new_message
        return Seen(reason, Tracked(now, Reason.no_image))

    def take(self, content: bytes, now: int) -> Seen:
        """Returns the row for a message that arrived at `now` [ns]."""
        try:
            message = Message.decoded(content)
        except ValueError:
            return Seen(ServerReason.invalid, Tracked(now, Reason.no_image))
        capture = self._clock.capture(message.stamp, now)
        if capture is None:  # repeated or overtaken
            return self.silent(now)
        self._newest = now
        if now - capture.time > self._max_age:
            return self._without(ServerReason.late, capture, message)
        if message.place is None:
            return self._without(ServerReason.not_seen, capture, message)
        place = self._rotation @ message.place + self._translation
        ball = self._flight.seen(
            capture.time, place, self._covariance, 0, math.nan, may_surprise=True
        )
        reason = ServerReason.seen if ball.seen else ServerReason.unexpected
        return Seen(reason, ball, capture, message.stamp)

    def _without(self, reason: ServerReason, capture: Capture, message: Message) -> Seen:
        ball = self._flight.lost(capture.time, Reason.not_found)
        return Seen(reason, ball, capture, message.stamp)
