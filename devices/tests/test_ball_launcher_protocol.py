"""Launches over a real connection: completed, rejected, timed out, never late, never twice."""

import time
from collections.abc import Callable, Iterator
from typing import cast

import pytest
import zmq
from launcher_bench import PATIENCE, Bench
from zmq.utils.monitor import parse_monitor_message

from o80 import RequestRejected
from o80_devices.ball_launcher.exchange import DELIVERED_WITHIN, Exchange, Outcome
from o80_devices.ball_launcher.launcher import CONFIRMATIONS, SECOND, LastLaunch, Launcher, Status
from o80_devices.ball_launcher.messages import Kind, Request, State
from o80_devices.fakes.ball_launcher import Behaviour, FakeLauncher

QUICK = Behaviour(state_time=0.0, launch_time=0.5)
Make = Callable[..., Bench]


@pytest.fixture
def make() -> Iterator[Make]:
    made: list[Bench] = []

    def bench(behaviour: Behaviour = QUICK) -> Bench:
        made.append(Bench(behaviour))
        made[-1].until(lambda: made[-1].status is Status.ready)
        return made[-1]

    yield bench
    for each in made:
        each.close()


class Missed:
    """The events of a connection that was lost and came back, all read at once."""

    def __init__(self, monitor: zmq.Socket[bytes]) -> None:
        self._monitor = monitor
        self._events: list[list[bytes]] = []
        newest = None
        while newest != zmq.EVENT_HANDSHAKE_SUCCEEDED:
            assert monitor.poll(round(1000 * PATIENCE))
            self._events.append(monitor.recv_multipart())
            newest = parse_monitor_message(self._events[-1])["event"]
        assert len(self._events) > 1

    def poll(self, timeout: int) -> bool:
        return bool(self._events) or self._monitor.poll(timeout) > 0

    def recv_multipart(self, flags: int) -> list[bytes]:
        return self._events.pop(0) if self._events else self._monitor.recv_multipart(flags)

    def close(self, linger: int) -> None:
        self._monitor.close(linger)


def finished(bench: Bench) -> LastLaunch:
    """How the launch under way ends."""
    before = sum(bench.client.counts.values())
    bench.until(lambda: sum(bench.client.counts.values()) > before)
    return bench.client.last_launch


def test_the_launcher_has_the_wanted_state_before_it_launches(make: Make) -> None:
    bench = make()
    bench.wanted = State(0.4, 0.6, 0.35, 0.35, 0.3)
    bench.client.ask(bench.now)
    assert finished(bench) is LastLaunch.completed
    assert bench.fake.state == bench.wanted.rounded() == bench.client.confirmed
    assert [request.kind for request in bench.fake.requests][-2:] == [
        Kind.SET_STATE,
        Kind.LAUNCH_BALL,
    ]


def test_a_second_launch_is_refused_while_one_is_under_way(make: Make) -> None:
    bench = make()
    bench.client.ask(bench.now)
    with pytest.raises(RequestRejected, match="under way"):
        bench.client.ask(bench.now)
    bench.until(lambda: bench.received == 1)
    with pytest.raises(RequestRejected, match="under way"):
        bench.client.ask(bench.now)
    assert finished(bench) is LastLaunch.completed


def test_a_launch_that_is_not_answered_makes_the_launcher_unknown(make: Make) -> None:
    bench = make(Behaviour(state_time=0.0, launch_time=1000.0))
    bench.client.ask(bench.now)
    assert finished(bench) is LastLaunch.timed_out
    assert bench.status is Status.unknown
    with pytest.raises(RequestRejected, match="may still be under way: no launch for 15"):
        bench.client.ask(bench.now)


def test_a_crash_in_a_launch_is_unknown_at_once_and_ends_after_the_longest_launch(
    make: Make,
) -> None:
    bench = make(Behaviour(state_time=0.0, launch_time=2.0, crash_at=1))
    bench.client.ask(bench.now)
    assert finished(bench) is LastLaunch.timed_out
    crashed = bench.now
    bench.fake.bind(bench.address)
    bench.until(lambda: bench.status is not Status.unknown)
    assert bench.now - crashed >= bench.timing.launch - SECOND
    bench.until(lambda: bench.status is Status.ready)
    bench.client.ask(bench.now)
    assert finished(bench) is LastLaunch.completed
    assert bench.received == 2


def test_a_new_state_is_sent_while_a_launch_is_unknown(make: Make) -> None:
    """A halt must stop the motors, also in that time. It does not end the wait for the launch."""
    bench = make(Behaviour(state_time=0.0, launch_time=2.0, crash_at=1))
    bench.wanted = State(top_left_motor=0.5)
    bench.client.ask(bench.now)
    assert finished(bench) is LastLaunch.timed_out
    bench.fake.bind(bench.address)
    bench.wanted = State(phi=0.25)
    bench.until(lambda: bench.fake.state == bench.wanted)
    assert bench.client.unknown_for(bench.now) > 0
    states = len(bench.fake.requests)
    bench.until(lambda: bench.status is not Status.unknown, SECOND // 10)
    assert bench.status is Status.setting
    assert len(bench.fake.requests) <= states + 1, "the state is sent again and again"
    bench.until(lambda: bench.status is Status.ready)
    assert len(bench.fake.requests) >= states + CONFIRMATIONS


class Scripted:
    """Exchanges that end as they are told, in this order."""

    def __init__(self, *outcomes: Outcome) -> None:
        self.outcomes = list(outcomes)
        self.requests: list[Request] = []
        self.sent = True

    def exchange(self, request: Request, deliver_by: int, wait: int) -> Exchange:
        self.requests.append(request)
        return cast(Exchange, self)

    def poll(self, now: int) -> Outcome:
        return self.outcomes.pop(0)


def test_a_state_that_was_not_delivered_does_not_count_as_a_confirmation() -> None:
    """The launcher may still hold a launch: two replies are needed to know that it does not."""
    done = Outcome.done
    wire = Scripted(Outcome.unanswered, Outcome.not_delivered, done, done)
    launcher, now = Launcher(wire.exchange), SECOND
    while len(wire.outcomes) > 1:
        launcher.step(now, True, State())
        now += 10 * SECOND
    assert launcher.status(now) is Status.setting
    launcher.step(now, True, State())
    assert launcher.status(now) is Status.ready


def test_an_old_launch_is_waited_for_even_if_the_launcher_sleeps_longer(make: Make) -> None:
    """It has the request, and takes it only after all deadlines of the client have passed."""
    bench = make()
    bench.client.ask(bench.now)
    while not (bench.launches_begun and bench.launches_begun[0][1].sent):
        bench.step()
    bench.now += 100 * SECOND
    bench.step()
    assert bench.client.last_launch is LastLaunch.timed_out
    bench.now += 100 * SECOND
    for _ in range(20):
        bench.step()
    assert bench.status is Status.setting
    bench.until(lambda: bench.status is Status.ready)
    assert bench.received == 1
    assert bench.fake.busy is None


def test_a_launch_to_a_launcher_that_has_gone_is_never_delivered_to_its_successor(
    make: Make,
) -> None:
    bench = make()
    bench.fake.die()
    request = Request(Kind.LAUNCH_BALL)
    end = bench.now + SECOND
    exchange = Exchange(zmq, bench.context, bench.address, request, end, SECOND)
    assert exchange.poll(bench.now) is Outcome.pending
    assert exchange.poll(end) is Outcome.not_delivered
    bench.fake.bind(bench.address)
    bench.until(lambda: bench.status is Status.ready)
    assert bench.received == 0


def test_a_launch_that_was_asked_for_before_the_connection_broke_is_not_sent(make: Make) -> None:
    bench = make()
    bench.client.ask(bench.now)
    bench.fake.die()
    end = time.monotonic() + PATIENCE
    while bench.link.is_up():
        assert time.monotonic() < end
    bench.step()
    assert bench.client.last_launch is LastLaunch.not_sent
    bench.fake.bind(bench.address)
    bench.until(lambda: bench.status is Status.ready)
    assert bench.received == 0


def test_a_launcher_that_restarts_between_two_steps_is_told_its_state_again(make: Make) -> None:
    """A late step of the driver sees both the loss and the new connection."""
    bench = make()
    bench.wanted = State(0.4, 0.6)
    bench.step()
    bench.until(lambda: bench.status is Status.ready)
    bench.fake.die()
    bench.fake.bind(bench.address)
    assert bench.fake.state == State()
    bench.link._monitor = Missed(bench.link._monitor)
    bench.step()
    assert bench.status is not Status.ready
    bench.until(lambda: bench.status is Status.ready)
    assert bench.fake.state == bench.wanted.rounded()


def test_the_kernel_gives_up_a_request_after_a_pulled_cable(make: Make) -> None:
    bench = make()
    exchange = Exchange(zmq, bench.context, bench.address, Request(Kind.LAUNCH_BALL), 0, SECOND)
    assert exchange._socket.getsockopt(zmq.TCP_MAXRT) == DELIVERED_WITHIN
    assert bench.timing.launch > DELIVERED_WITHIN * 1_000_000
    exchange.close()


def test_a_refused_state_refuses_launches_until_another_one_is_wanted(make: Make) -> None:
    bench = make()
    accepting = bench.fake._behaviour
    bench.fake._behaviour = Behaviour(state_time=0.0, refuse=1.0)
    bench.wanted = State(0.9)
    bench.until(lambda: bench.status is Status.refused)
    with pytest.raises(RequestRejected, match="change it"):
        bench.client.ask(bench.now)
    bench.fake._behaviour = accepting
    bench.wanted = State(0.8)
    bench.until(lambda: bench.status is Status.ready)


def test_a_fake_launcher_answers_nonsense_with_a_failure() -> None:
    fake = FakeLauncher(QUICK)
    with zmq.Context() as context, context.socket(zmq.REQ) as socket:
        socket.setsockopt(zmq.LINGER, 0)
        socket.connect(fake.bind("tcp://127.0.0.1:0"))
        socket.send(b"hello")
        fake.step(0, wait=30.0)
        assert socket.recv() == b"0"
    fake.close()
