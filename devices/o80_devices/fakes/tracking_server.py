"""Fake tracking server that publishes thrown or recorded balls.

python -m o80_devices.fakes.tracking_server --lose 0.1
python -m o80_devices.fakes.tracking_server --recording o80_robot_ball_002
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np

from o80.base.extras import needed
from o80.base.screen import keep_printing
from o80_devices.ball_tracking.robot_and_ball import RobotAndBall
from o80_devices.ball_tracking.server_messages import Message
from o80_devices.cameras.rig import four_cameras
from o80_devices.cameras.throws import Throws
from o80_devices.fakes import numbers

SECOND = 1_000_000_000  # [ns]
RATE = 180.0  # [1/s]


class FakeTrackingServer:
    """Publishes messages over ZeroMQ."""

    def __init__(self, address: str) -> None:
        """address: port 0 takes any free one."""
        zmq = needed("zmq", "zeromq", "a tracking server", package="o80-devices")
        self._context = zmq.Context()
        self._socket: Any = self._context.socket(zmq.PUB)
        self._socket.setsockopt(zmq.LINGER, 0)
        self._socket.bind(address)
        self.address: str = self._socket.getsockopt(zmq.LAST_ENDPOINT).decode().rstrip("\0")

    def publish(self, message: Message | bytes) -> None:
        self._socket.send(message if isinstance(message, bytes) else message.encoded())

    def close(self) -> None:
        if self._socket.closed:
            return
        self._socket.close(linger=0)
        self._context.destroy(linger=0)


def thrown(seed: int, noise: float, rate: float = RATE) -> Iterator[tuple[int, Message]]:
    """Generates messages of thrown balls, each with its send time [ns]."""
    throws, rng = Throws(four_cameras(), seed), np.random.default_rng(seed)
    for frame in count():
        at = round(frame * SECOND / rate)
        ball = throws.at(at / SECOND)
        place = ball.position + noise * rng.standard_normal(3) if ball.number else None
        yield at, Message(at, place)


def recorded(path: Path) -> Iterator[tuple[int, Message]]:
    """Generates the messages of a recording, with send times from 0 on [ns]."""
    messages = RobotAndBall.load(path).messages()
    for at, message in messages:
        yield at - messages[0][0], message


def main(arguments: list[str] | None = None) -> None:
    parser = numbers.parser(
        "tracking_server",
        address=(str, "tcp://127.0.0.1:7660", "where it publishes"),
        recording=(Path, None, "file of a robot and a ball to play"),
        noise=(numbers.not_negative, 0.003, "of thrown balls [m]"),
        lose=(numbers.share, 0.0, "share of messages that are lost"),
        clock=(numbers.not_negative, 1e9, "its clock at the start [s]"),
        pause_at=(float, -1.0, "when it makes a pause [s]"),
        pause=(numbers.not_negative, 2.0, "for how long [s]"),
        seed=(numbers.count, 0, "of the throws and losses"),
    )
    given = parser.parse_args(arguments)
    zmq = needed("zmq", "zeromq", "a tracking server", package="o80-devices")
    messages = recorded(given.recording) if given.recording else thrown(given.seed, given.noise)
    try:
        server = FakeTrackingServer(given.address)
    except zmq.ZMQError as error:
        parser.error(f"the address {given.address} cannot be used: {error}")
    print(f"fake tracking server at {server.address}; Ctrl-C ends it", flush=True)
    rng, start = np.random.default_rng(given.seed), time.monotonic_ns()
    first: int | None = None
    try:
        for at, message in messages:
            time.sleep(max(0.0, (start + at - time.monotonic_ns()) / SECOND))
            first = message.stamp if first is None else first
            stamp = message.stamp - first + round(given.clock * SECOND)
            paused = 0.0 <= at / SECOND - given.pause_at < given.pause and given.pause_at >= 0.0
            if not paused and rng.random() >= given.lose:
                server.publish(Message(stamp, message.place))
    except KeyboardInterrupt:
        pass
    finally:
        server.close()


if __name__ == "__main__":
    keep_printing()
    main()
