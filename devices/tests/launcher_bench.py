"""A launcher and a fake one on a real connection, both stepped by the test, with its own clock."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import zmq

from o80_devices.ball_launcher.exchange import Exchange
from o80_devices.ball_launcher.launcher import SECOND, Launcher, Status, Timing
from o80_devices.ball_launcher.link import Link
from o80_devices.ball_launcher.messages import Kind, Request, State
from o80_devices.fakes.ball_launcher import Behaviour, FakeLauncher

PATIENCE = 60.0  # [s] longer than anything here takes on any machine
TICK = SECOND // 100


class Bench:
    """Time passes only by `now`; connections are real."""

    def __init__(self, behaviour: Behaviour, timing: Timing = Timing()) -> None:  # noqa: B008
        self.now = 1_000 * SECOND
        self.timing = timing
        self.wanted = State()
        self.fake = FakeLauncher(behaviour)
        self.address = self.fake.bind("tcp://127.0.0.1:0")
        self.context = zmq.Context()
        self.launches_begun: list[tuple[int, Exchange]] = []
        self.before_launch: Callable[[], None] = lambda: None
        self.connect()

    def connect(self) -> None:
        self.link = Link(zmq, self.context, self.address, 0.0)
        self.client = Launcher(self.exchange, self.timing)

    def exchange(self, request: Request, deliver_by: int, wait: int) -> Exchange:
        if request.kind is Kind.LAUNCH_BALL:
            self.before_launch()
        begun = Exchange(zmq, self.context, self.address, request, deliver_by, wait)
        if request.kind is Kind.LAUNCH_BALL:
            self.launches_begun.append((self.now, begun))
        return begun

    @property
    def status(self) -> Status:
        return self.client.status(self.now)

    @property
    def received(self) -> int:
        """Launches that have reached the fake one."""
        return [request.kind for request in self.fake.requests].count(Kind.LAUNCH_BALL)

    def step(self) -> None:
        """A step of the client."""
        self.client.step(self.now, self.link.is_up(), self.wanted)

    def serve(self) -> None:
        """A step of the fake launcher."""
        self.fake.step(self.now, wait=0.001)

    def until(self, condition: Callable[[], Any], tick: int = TICK) -> None:
        """Goes on until the condition holds. tick: by which the clock goes on for each step."""
        end = time.monotonic() + PATIENCE
        while not condition():
            assert time.monotonic() < end, f"it stays {self.status.name}"
            self.step()
            self.serve()
            self.now += tick

    def stop_client(self) -> None:
        self.client.close()
        self.link.close()

    def close(self) -> None:
        self.stop_client()
        self.context.destroy(linger=0)
        self.fake.close()
