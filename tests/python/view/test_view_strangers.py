"""Connections without the token, and slow ones, keep no halt from the server of `o80 view`."""

import json
import select
import socket
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from http.client import HTTPConnection
from typing import Any
from urllib.parse import urlsplit

import pytest
from processes import WAIT, Running

import o80
from o80.view.serve import page_server
from o80.view.server import PageServer

NEVER = 1e6  # [s]

Serve = Callable[..., PageServer]


@pytest.fixture
def serve(arm: o80.Frontend, monkeypatch: pytest.MonkeyPatch) -> Iterator[Serve]:
    """Starts a server with other constants. Without them no connection is closed for its age."""
    with ExitStack() as servers:

        def start(**constants: float) -> PageServer:
            ages = ("HEAD_WITHIN", "BODY_WITHIN", "IDLE", "REFUSED_AFTER")
            for name, value in {**dict.fromkeys(ages, NEVER), **constants}.items():
                monkeypatch.setattr(f"o80.view.gate.{name}", value)
            return servers.enter_context(page_server([arm.segment]))

        yield start


class Holder:
    """A connection that shows the token and is kept."""

    def __init__(self, port: int, token: str) -> None:
        self._token = token
        self.kept = HTTPConnection("127.0.0.1", port, timeout=WAIT)
        self.kept.connect()
        self.kept.auto_open = False  # a connection that was closed is an error

    def ask(self, path: str, **requested: Any) -> Any:
        headers = {"Authorization": f"Bearer {self._token}"}
        self.kept.request("POST", path, json.dumps(requested), headers)
        answer = self.kept.getresponse()
        text = answer.read()
        assert answer.status == 200, text
        return json.loads(text)

    @property
    def socket(self) -> socket.socket:
        found: socket.socket = self.kept.sock
        return found


@contextmanager
def holders(server: PageServer, count: int) -> Iterator[list[Holder]]:
    found = [Holder(server.port, server.token) for _ in range(count)]
    try:
        yield found
    finally:
        for each in found:
            each.kept.close()


def halt(port: int, token: str, segment: str) -> int:
    """On a connection of its own; the number of the halt."""
    holder = Holder(port, token)
    try:
        number: int = holder.ask("/halt", segment=segment)["halt"]
        return number
    finally:
        holder.kept.close()


def closed(connection: socket.socket) -> bool:
    connection.setblocking(False)
    try:
        return not connection.recv(1 << 16)
    except BlockingIOError:
        return False
    except OSError:
        return True


def hostile(port: int) -> list[bytes]:
    """Begins of requests: none, some bytes, a body that never comes, no token, a wrong one."""
    head = f"POST /halt HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\n".encode()
    return [
        b"",
        b"P",
        head,
        head + b"X: " + b"a" * 9000,
        head + b"Content-Length: 60000\r\n\r\nx",
        head + b"Authorization: Bearer wrong\r\nContent-Length: 2\r\n\r\n{}",
        head + b"Content-Length: " + b"9" * 5000 + b"\r\n\r\n",
        b"\x16\x03\x01\0" * 100,
    ]


@contextmanager
def strangers(port: int, count: int) -> Iterator[Iterator[socket.socket]]:
    """Connects them one after the other, as they are taken."""
    with ExitStack() as all_of_them:

        def connect() -> Iterator[socket.socket]:
            sent = hostile(port)
            for number in range(count):
                connection = socket.create_connection(("127.0.0.1", port), WAIT)
                all_of_them.enter_context(connection)
                connection.sendall(sent[number % len(sent)])
                yield connection

        yield connect()


def test_all_halts_arrive_among_strangers_the_oldest_of_which_are_closed(
    serve: Serve, arm: o80.Frontend
) -> None:
    budget = 100
    server = serve(MAX_STRANGERS=budget, MAX_HOLDERS=50)
    halts: list[int] = []
    attackers: list[socket.socket] = []
    with holders(server, 20) as kept, strangers(server.port, 400) as attack:
        for each in kept:
            each.ask("/look")
        for number, attacker in enumerate(attack):
            attackers.append(attacker)
            if number % 8 == 7:
                halts.append(halt(server.port, server.token, arm.segment))
        assert halts == list(range(halts[0], halts[0] + 50)), "each arrived, once"
        assert [each.ask("/look")["source"] for each in kept] == [arm.segment] * 20
        gone = [closed(each) for each in attackers]
        assert gone == sorted(gone, reverse=True), "none is closed before an older one"
        # a halt was itself a stranger, until its head was read
        assert budget - 1 <= gone.count(False) <= budget


def test_a_holder_too_many_costs_the_one_whose_last_request_is_the_oldest(serve: Serve) -> None:
    server = serve(MAX_HOLDERS=5)
    with holders(server, 8) as kept:
        for each in kept[:5]:
            each.ask("/look")
        kept[0].ask("/look")
        for each in kept[5:]:
            each.ask("/look")
        gone = [closed(each.socket) for each in kept]
        assert gone == [False, True, True, True, False, False, False, False]


def test_holders_that_stall_in_a_body_do_not_keep_a_halt_out(
    serve: Serve, arm: o80.Frontend
) -> None:
    server = serve(MAX_HOLDERS=5)
    head = (
        f"POST /look HTTP/1.1\r\nHost: 127.0.0.1:{server.port}\r\n"
        f"Authorization: Bearer {server.token}\r\nContent-Length: 9\r\n\r\n{{"
    ).encode()
    with ExitStack() as stalled:
        for _ in range(20):
            connection = socket.create_connection(("127.0.0.1", server.port), WAIT)
            stalled.enter_context(connection).sendall(head)
        assert halt(server.port, server.token, arm.segment) > 0


@pytest.mark.parametrize(
    ("begin", "after_a_request"),
    [("", False), ("POST /look HTTP/1.1\r\nX: ", False), ("", True), ("body", True)],
)
def test_each_byte_does_not_renew_the_deadline(
    serve: Serve, begin: str, after_a_request: bool
) -> None:
    server = serve(HEAD_WITHIN=0.2, BODY_WITHIN=0.2)
    if begin == "body":
        begin = (
            f"POST /look HTTP/1.1\r\nHost: 127.0.0.1:{server.port}\r\n"
            f"Authorization: Bearer {server.token}\r\nContent-Length: 60000\r\n\r\n"
        )
    with holders(server, 1) as [holder]:
        if after_a_request:
            while True:  # a busy machine may need longer than a head may take
                try:
                    holder.ask("/look")
                    break
                except OSError:
                    holder.kept.connect()
        connection = holder.socket
        connection.sendall(begin.encode())
        drip_until_closed(connection)


def drip_until_closed(connection: socket.socket) -> None:
    poll = select.poll()
    poll.register(connection, select.POLLIN)
    give_up = time.monotonic() + WAIT
    while time.monotonic() < give_up:
        try:
            connection.send(b"a")
        except OSError:
            return
        if poll.poll(10):
            assert closed(connection)
            return
    raise AssertionError("it is never closed")


def test_a_refusal_is_told_after_a_while_and_its_connection_closed(serve: Serve) -> None:
    server = serve(REFUSED_AFTER=0.05, CLOSED_AFTER=0.05)
    with socket.create_connection(("127.0.0.1", server.port), WAIT) as connection:
        connection.sendall(hostile(server.port)[5])
        text = connection.makefile().read()  # until it is closed
        assert text.startswith("HTTP/1.1 403")
        assert "the token is missing or wrong" in text
        drip_until_closed(connection)


def test_halts_arrive_with_few_descriptors(arm: o80.Frontend) -> None:
    options = json.dumps({"names": [arm.segment]})
    command = 'ulimit -n 64 && exec "$0" -m o80.view "$1"'
    with Running("sh", "-c", command, sys.executable, options) as process:
        said = json.loads(process.stdout.readline())
        token = urlsplit(said["url"]).query.removeprefix("token=")
        with strangers(said["port"], 150) as attack:
            for number, _ in enumerate(attack):
                if number % 15 == 14:
                    assert halt(said["port"], token, arm.segment) == 1 + number // 15
        process.stdin.close()
        assert process.wait(WAIT) == 0
