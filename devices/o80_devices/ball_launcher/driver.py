"""The driver of the ball launcher: angles and motors as actuators, a launch as a request."""

from __future__ import annotations

import time
from dataclasses import astuple, dataclass
from functools import partial
from typing import ClassVar

import numpy as np

import o80
from o80.base.extras import needed
from o80.base.screen import complain
from o80.drivers import Desired, Reading, option
from o80_devices.ball_launcher.exchange import DELIVERED_WITHIN, Exchange, Outcome
from o80_devices.ball_launcher.launcher import (
    CONFIRMATIONS,
    SECOND,
    LastLaunch,
    Launcher,
    Status,
    Timing,
)
from o80_devices.ball_launcher.link import Link
from o80_devices.ball_launcher.messages import NAMES, Kind, Request, State

POLL = 0.005  # [s]
MIN_WAIT = 1e-3 * DELIVERED_WITHIN  # for a reply [s]


@dataclass
class Options:
    """Options of the ball launcher."""

    address: str = option("tcp://127.0.0.1:5555", "where the launcher listens")
    phi: float = option(0.5, "azimuth at the start, in [0, 1]")
    theta: float = option(0.5, "altitude at the start, in [0, 1]")
    state_timeout: float = option(5.0, "the longest that a change of state takes", "s")
    launch_timeout: float = option(15.0, "the longest that a launch takes", "s")
    deliver_timeout: float = option(0.5, "for the connection of a request", "s")
    heartbeat_timeout: float = option(
        0.075, "without a heartbeat, after which it is disconnected; 0: no heartbeats", "s"
    )
    stop_timeout: float = option(3.0, "for stopping the motors at the end", "s")


class BallLauncher:
    """Drives a ball launcher over ZeroMQ.

    The motors are at rest until the first command, during a halt, and after the end.
    """

    Config = Options
    frequency = 50.0
    actuators = NAMES
    limits: ClassVar = dict.fromkeys(NAMES, o80.Limits(minimum=0.0, maximum=1.0))
    extended: ClassVar = {
        "status": Status,
        "connected": bool,
        "capture_time": np.int64,
        "unknown_for": float,
        "last_launch": LastLaunch,
        "launch_time": np.int64,
        "completed": np.int64,
        "rejected": np.int64,
        "not_sent": np.int64,
        "timed_out": np.int64,
    }
    units: ClassVar = {"capture_time": "ns", "unknown_for": "s", "launch_time": "ns"}
    requests: ClassVar = {"launch": None}

    def __init__(self, config: Options) -> None:
        for name in ("state_timeout", "launch_timeout", "deliver_timeout", "stop_timeout"):
            if not 0.0 < getattr(config, name) < 1e6:
                raise o80.InvalidArgument(
                    f"{name} must be positive [s], got {getattr(config, name):g}"
                )
        for name in ("state_timeout", "launch_timeout"):
            if getattr(config, name) < MIN_WAIT:
                raise o80.InvalidArgument(
                    f"{name} must be at least {MIN_WAIT:g} s, because the kernel may deliver a "
                    f"request so late, got {getattr(config, name):g}"
                )
        if config.heartbeat_timeout != 0.0 and not 0.01 <= config.heartbeat_timeout <= 60.0:
            raise o80.InvalidArgument(
                "heartbeat_timeout must be 0, or between 0.01 and 60 s, got "
                f"{config.heartbeat_timeout:g}"
            )
        for name in ("phi", "theta"):
            if not 0.0 <= getattr(config, name) <= 1.0:
                raise o80.InvalidArgument(
                    f"{name} must be between 0 and 1, got {getattr(config, name):g}"
                )
        self._config = config
        self._wanted = self._known = State(config.phi, config.theta)
        self._halted = self._was_connected = False

    # ------------------------------------------------------------------ verbs

    def start(self) -> None:
        Request(Kind.LAUNCH_BALL).encoded()  # reports a missing protobuf at the start
        zmq = needed("zmq", "zeromq", "the ball launcher", package="o80-devices")
        self._context = zmq.Context()
        config = self._config
        self._link = Link(zmq, self._context, config.address, config.heartbeat_timeout)
        timing = Timing(
            deliver=round(config.deliver_timeout * SECOND),
            state=round(config.state_timeout * SECOND),
            launch=round(config.launch_timeout * SECOND),
        )
        self._exchange = partial(Exchange, zmq, self._context, config.address)
        self._launcher = Launcher(self._exchange, timing)

    def write(self, desired: Desired) -> None:
        if not self._halted:
            self._wanted = State(*(float(value) for value in desired.states))

    def read(self, reading: Reading) -> None:
        launcher, now = self._launcher, time.monotonic_ns()
        if reading.fresh:
            self._halted = False
        if not reading.runs("launch"):
            launcher.cancel()
        connected = self._link.is_up()
        self._was_connected = self._was_connected or connected
        launcher.step(now, connected, self._wanted)
        status = launcher.status(now)
        if (end := launcher.ended()) is not None:
            how, why = end
            reading.ended("launch", rejected=None if how is LastLaunch.completed else why)
        elif reading.runs("launch"):
            reading.progress("launch", _PROGRESS.get(status, "waits for the launcher"))
        known = launcher.confirmed
        self._known = self._known if known is None else known
        reading.observed = astuple(self._known)
        reading.extended = {
            "status": status,
            "connected": connected,
            "capture_time": 0 if known is None else reading.time,
            "unknown_for": launcher.unknown_for(now) / SECOND,
            "last_launch": launcher.last_launch,
            "launch_time": launcher.launched_at,
            **{how.name: launcher.counts[how] for how in LastLaunch if how is not LastLaunch.none},
        }

    def on_launch(self, _fields: o80.Record) -> o80.Running:
        self._launcher.ask(time.monotonic_ns())
        return o80.Running("waits until the launcher has confirmed its state")

    def halt(self) -> None:
        self._halted = True
        self._launcher.cancel()
        self._wanted = State(self._wanted.phi, self._wanted.theta)

    def resume(self) -> None:
        """Continues from the observed state, in which the motors are at rest."""
        self._known = self._wanted

    def stop(self) -> None:
        if not hasattr(self, "_launcher"):
            return
        replies = CONFIRMATIONS if self._launcher.may_hold_older_requests else 1
        self._launcher.close()
        if self._link.is_up():
            self._stop_motors(replies)
        elif self._was_connected:
            self._warn("is disconnected, so its motors cannot be stopped")
        self._link.close()
        self._context.destroy(linger=0)

    def _stop_motors(self, replies: int) -> None:
        seconds = self._config.stop_timeout
        end = time.monotonic_ns() + round(seconds * SECOND)
        if not all(self._motors_stop(end) for _ in range(replies)):
            self._warn(f"did not confirm within {seconds:g} s that its motors stop")

    def _motors_stop(self, end: int) -> bool:
        """Whether the launcher confirms stopped motors before `end` [ns]."""
        now = time.monotonic_ns()
        state = State(self._wanted.phi, self._wanted.theta)
        last = self._exchange(Request(Kind.SET_STATE, state), end, max(0, end - now))
        while last.poll(now) is Outcome.pending and now < end:
            time.sleep(POLL)
            now = time.monotonic_ns()
        last.close()
        return last.outcome is Outcome.done

    def _warn(self, what: str) -> None:
        address = self._config.address
        complain(f"the ball launcher at {address} {what}: check that they stand still")


_PROGRESS = {
    Status.setting: "waits until the launcher has confirmed its state",
    Status.ready: "sends the launch",
    Status.launching: "waits for the launcher to launch",
}
