"""Fake ball launcher with the protocol and delays of the real one, and faults on request.

python -m o80_devices.fakes.ball_launcher --magazine 20 --refuse 0.1
python -m o80_devices.fakes.ball_launcher --tracking tcp://127.0.0.1:7660
"""

from __future__ import annotations

import contextlib
import socket
import time
from collections.abc import Callable
from dataclasses import astuple, dataclass
from typing import Any

import numpy as np

from o80.base.extras import needed
from o80.base.screen import keep_printing
from o80_devices.ball_launcher.launch_model import LAUNCH_MODEL, Launch, LaunchModel
from o80_devices.ball_launcher.messages import Kind, Request, State
from o80_devices.ball_launcher.wheel_speeds import actuation_of, speed_of
from o80_devices.fakes import numbers

SECOND = 1_000_000_000  # [ns]
FREED_WITHIN = 2.0
"""Timeout of an address that is still in use at a restart [s]."""
PLACE = (0.4, 2.95, 0.033)
"""Place of the launcher with --tracking, beyond the far end of the table [m]."""
YAW = -1.5708
"""Direction of the launches, towards smaller y [rad]."""
TRACKING_NOISE = 0.003
"""Standard deviation of a tracked place [m]."""
LEAVES = 0.8
"""Share of a launch's duration after which the ball leaves."""


@dataclass(frozen=True)
class Behaviour:
    """Durations and faults of the fake launcher."""

    state_time: float = 1.0
    """Duration of a change of state [s]."""
    launch_time: float = 3.0
    """Duration of a launch, stirring included [s]."""
    magazine: int = 100
    """Number of balls; a launch without one fails."""
    refuse: float = 0.0
    """Share of the requests that fail."""
    crash_at: int = 0
    """Number of the launch, from 1, during which the launcher crashes; 0: none."""
    seed: int = 0


class FakeLauncher:
    """Fake launcher, advanced by `step`, which returns at once. A crash lasts until `bind`."""

    def __init__(
        self,
        behaviour: Behaviour = Behaviour(),
        *,
        model: LaunchModel = LAUNCH_MODEL,
        on_launch: Callable[[Launch], None] | None = None,
        say: Callable[[str], None] | None = None,
    ) -> None:
        self._zmq = needed("zmq", "zeromq", "the ball launcher", package="o80-devices")
        self._context = self._zmq.Context()
        self._behaviour = behaviour
        self._model = model
        self._on_launch = on_launch
        self._say = say or (lambda text: None)
        self._rng = np.random.default_rng(behaviour.seed)
        self._socket: Any = None
        self.state = State()
        self.magazine = behaviour.magazine
        self.requests: list[Request] = []
        """All received requests."""
        self.launches: list[Launch] = []
        """All launched balls."""
        self._busy: Request | None = None
        self._began = self._until = 0
        self._ball_left = False

    # ------------------------------------------------------------------ start and crash

    def bind(self, address: str) -> str:
        """Listens, and returns the address; port 0 takes any free port."""
        made = self._context.socket(self._zmq.REP)
        made.setsockopt(self._zmq.LINGER, 0)
        made.bind(address)
        bound: str = made.getsockopt(self._zmq.LAST_ENDPOINT).decode().rstrip("\0")
        self._socket, self._bound = made, bound
        return bound

    def die(self) -> None:
        """Drops connections, the open request and the state."""
        if self._socket is not None:
            self._socket.close(linger=0)
            _wait_until_closed(self._bound)
        self._socket, self._busy, self.state = None, None, State()

    def close(self) -> None:
        self.die()
        self._context.destroy(linger=0)

    @property
    def alive(self) -> bool:
        return self._socket is not None

    @property
    def busy(self) -> Request | None:
        """Request that is being served."""
        return self._busy

    # ------------------------------------------------------------------ work

    def step(self, now: int, wait: float = 0.0) -> None:
        """Continues a request, or accepts one within `wait` [s]."""
        if self._socket is None:
            return
        if self._busy is None:
            if self._socket.poll(round(1000 * wait)):
                self._take(self._socket.recv(self._zmq.NOBLOCK), now)
            return
        if self._busy.kind is Kind.LAUNCH_BALL:
            self._launch(now)
        if self._busy is not None and now >= self._until:
            self._answer()

    def _take(self, content: bytes, now: int) -> None:
        try:
            request = Request.decoded(content)
        except ValueError as error:
            self._say(str(error))
            self._socket.send(b"0")
            return
        self.requests.append(request)
        self._say(f"received {request.kind.name}{_state_text(request.state)}")
        behaviour = self._behaviour
        takes = behaviour.launch_time if request.kind is Kind.LAUNCH_BALL else behaviour.state_time
        self._busy, self._began, self._until = request, now, now + round(takes * SECOND)
        self._fails = bool(self._rng.random() < behaviour.refuse)
        if request.kind is Kind.LAUNCH_BALL and self.magazine == 0:
            self._fails = True
        self._ball_left = False

    def _launch(self, now: int) -> None:
        """Launches the ball near the end of the launch time, or crashes before that."""
        share = (now - self._began) / max(1, self._until - self._began)
        kinds = [request.kind for request in self.requests]
        if share >= 0.5 and kinds.count(Kind.LAUNCH_BALL) == self._behaviour.crash_at:
            self._say("crashes in the middle of a launch")
            self.die()
            return
        if share >= LEAVES and not self._ball_left and not self._fails:
            self._ball_left = True
            self.magazine -= 1
            speeds = tuple(speed_of(value) for value in astuple(self.state)[2:])
            assert len(speeds) == 3
            ball = self._model.launch(self.state.phi, self.state.theta, speeds, self._rng)
            self.launches.append(ball)
            self._say(
                f"launched a ball at {float(np.linalg.norm(ball.velocity)):.2f} m/s, "
                f"{self.magazine} left"
            )
            if self._on_launch is not None:
                self._on_launch(ball)

    def _answer(self) -> None:
        assert self._busy is not None
        request, self._busy = self._busy, None
        if not self._fails:
            self._set(request)
        self._say(f"{'failed' if self._fails else 'done'}: {request.kind.name}")
        self._socket.send(b"0" if self._fails else b"1")

    def _set(self, request: Request) -> None:
        if request.state is None or request.kind is Kind.LAUNCH_BALL:
            return
        if request.kind is Kind.SET_RPM:
            motors = (actuation_of(min(3970.0, max(0.0, v))) for v in astuple(request.state)[2:])
            self.state = State(self.state.phi, self.state.theta, *motors)
        else:
            self.state = request.state


def _wait_until_closed(address: str) -> None:
    """Waits until the address is free, because ZeroMQ closes a socket in the background."""
    host, _, port = address.removeprefix("tcp://").rpartition(":")
    end = time.monotonic() + FREED_WITHIN
    while time.monotonic() < end:
        with socket.socket() as probe:
            if probe.connect_ex((host, int(port))) != 0:
                return
        time.sleep(0.001)


def _state_text(state: State | None) -> str:
    return "" if state is None else " " + " ".join(f"{value:.3g}" for value in astuple(state))


def serve(fake: FakeLauncher, address: str, restart: float) -> None:
    """Serves until Ctrl-C; restarts `restart` [s] after a crash, or returns if that is negative."""
    while True:
        fake.bind(address)
        while fake.alive:
            fake.step(time.monotonic_ns(), wait=0.1)
            if fake.busy is not None:
                time.sleep(0.005)
        if restart < 0:
            return
        time.sleep(restart)


def main(arguments: list[str] | None = None) -> None:
    usual = Behaviour()
    parser = numbers.parser(
        "ball_launcher",
        address=(str, "tcp://127.0.0.1:5555", "where it listens"),
        state_time=(numbers.not_negative, usual.state_time, "of a change of state [s]"),
        launch_time=(numbers.not_negative, usual.launch_time, "of a launch [s]"),
        magazine=(numbers.count, usual.magazine, "balls in it"),
        refuse=(numbers.share, usual.refuse, "share of requests that fail"),
        crash_at=(numbers.count, usual.crash_at, "dies in the middle of this launch"),
        restart=(float, -1.0, "after a crash [s]; -1: never"),
        seed=(numbers.count, usual.seed, "of the scatter of launches"),
        tracking=(str, "", "address at which the balls are published as tracked"),
        place=(numbers.vector, PLACE, "of the launcher in the world [m]"),
        yaw=(float, YAW, "of the launcher [rad]"),
    )
    given = vars(parser.parse_args(arguments))
    zmq = needed("zmq", "zeromq", "the ball launcher", package="o80-devices")
    address, restart, tracking = given.pop("address"), given.pop("restart"), given.pop("tracking")
    place, yaw = given.pop("place"), given.pop("yaw")
    with contextlib.ExitStack() as stack:
        on_launch = None
        if tracking:
            from o80_devices.fakes.launched_balls import LaunchedBalls, TrackedLauncher

            balls = LaunchedBalls(place, yaw, noise=TRACKING_NOISE, seed=given["seed"])
            try:
                on_launch = stack.enter_context(TrackedLauncher(tracking, balls)).launched
            except zmq.ZMQError as error:
                parser.error(f"the address {tracking} cannot be used: {error}")
        fake = FakeLauncher(
            Behaviour(**given), on_launch=on_launch, say=lambda text: print(text, flush=True)
        )
        stack.callback(fake.close)
        print(f"fake ball launcher at {address}; Ctrl-C ends it", flush=True)
        try:
            serve(fake, address, restart)
        except zmq.ZMQError as error:
            parser.error(f"the address {address} cannot be used: {error}")
        except KeyboardInterrupt:
            pass


if __name__ == "__main__":
    keep_printing()
    main()
