"""RealtimeKit: the priority that `o80 run` asks it for, and what it does without one."""

import contextlib
import ctypes
import itertools
import os
import re
import resource
import shutil
import signal
import socket
import struct
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Self

import pytest
from processes import O80, WAIT, Running, may_use_fifo

import o80

_count = itertools.count()
LONGEST = 200_000  # longest time of a thread without sleep [us]
ERROR = "org.freedesktop.DBus.Error."
METHOD_RETURN, METHOD_ERROR = 2, 3
ERROR_NAME, REPLY_TO, SIGNATURE = 4, 5, 8  # fields of a message's head


class RealtimeKit:
    """Answers according to `mood`, and stores the requests.

    Moods: grants, agrees (and changes nothing), refuses, absent (no such service on the
    bus), late (no answer about a thread), silent (no answer at all), rude (closes at once).
    """

    def __init__(self, mood: str = "grants") -> None:
        self.mood = mood
        self.asked: list[tuple[int, int]] = []  #: thread, priority
        self.callers = 0
        name = f"o80-test-bus-{os.getpid()}-{next(_count)}"
        self.address = f"unix:abstract={name}"
        self._bus = socket.socket(socket.AF_UNIX)
        self._bus.bind(f"\0{name}")
        self._bus.listen()
        self._thread = threading.Thread(target=self._serve, daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._bus.shutdown(socket.SHUT_RDWR)
        self._thread.join()
        self._bus.close()

    def _serve(self) -> None:
        while True:
            try:
                caller, _ = self._bus.accept()
            except OSError:
                return
            self.callers += 1
            with caller:
                while self.mood == "silent" and caller.recv(4096):
                    pass
                if self.mood not in ("silent", "rude"):
                    self._let_in(caller)
                    for serial, member, body in self._messages(caller):
                        if (answer := self._answer(member, body)) is not None:
                            caller.sendall(message(serial, *answer))

    def _let_in(self, caller: socket.socket) -> None:
        text = b""
        while b"BEGIN\r\n" not in text:
            text += caller.recv(1)
        # older libraries send their identity with AUTH, newer ones on request
        asks = b"DATA\r\n" if b"EXTERNAL\r\n" in text else b""
        caller.sendall(asks + b"OK 0123456789abcdef0123456789abcdef\r\nERROR\r\n")

    def _messages(self, caller: socket.socket) -> Iterator[tuple[int, str, bytes]]:
        """Reads calls: serial number, member and body of each."""
        while len(head := caller.recv(16, socket.MSG_WAITALL)) == 16:
            size, serial, fields = struct.unpack("<III", head[4:])
            rest = caller.recv(fields + -fields % 8 + size, socket.MSG_WAITALL)
            member = re.search(rb"\x03\x01s\0....(\w+)", rest, re.DOTALL)
            assert member is not None
            yield serial, member[1].decode(), rest[fields + -fields % 8 :]

    def _answer(self, member: str, body: bytes) -> tuple[str, str, bytes] | None:
        """Returns error name or "", signature and body; None: no answer."""
        if member == "Hello":
            return "", "s", string(":1.1")
        if self.mood == "absent":
            return ERROR + "ServiceUnknown", "s", string("no such service")
        if member == "Get":
            if b"RTTimeUSecMax" in body:
                return "", "v", struct.pack("<B2sxxxxxq", 1, b"x\0", LONGEST)
            return "", "v", struct.pack("<B2sxi", 1, b"i\0", 20)
        assert member == "MakeThreadRealtime"
        thread, priority = struct.unpack("<QI", body)
        self.asked.append((thread, priority))
        if self.mood == "late":
            return None
        if self.mood == "refuses":
            return ERROR + "AccessDenied", "s", string("not you")
        if self.mood == "grants":
            policy = os.SCHED_RR | os.SCHED_RESET_ON_FORK
            os.sched_setscheduler(thread, policy, os.sched_param(priority))
        return "", "", b""


def string(text: str) -> bytes:
    return struct.pack(f"<I{len(text) + 1}s", len(text), text.encode())


def message(serial: int, error: str, signature: str, body: bytes) -> bytes:
    """Encodes the answer to the call with this serial number."""
    fields = bytes([REPLY_TO, 1, ord("u"), 0]) + struct.pack("<I", serial)
    if error:
        fields += bytes([ERROR_NAME, 1, ord("s"), 0]) + string(error)
        fields += bytes(-len(fields) % 8)
    if signature:
        fields += bytes([SIGNATURE, 1, ord("g"), 0, len(signature)]) + signature.encode() + b"\0"
    kind = METHOD_ERROR if error else METHOD_RETURN
    head = struct.pack("<cBBBIII", b"l", kind, 1, 1, len(body), serial + 1000, len(fields))
    return head + fields + bytes(-len(fields) % 8) + body


HERE = Path(__file__).parents[1]
GRANTED = os.SCHED_RR | os.SCHED_RESET_ON_FORK
ORDINARY = os.SCHED_OTHER | os.SCHED_RESET_ON_FORK
NOWHERE = "unix:path=/nowhere"
Run = Callable[..., Running]

try:
    ctypes.CDLL("libsystemd.so.0")
except OSError:
    pytest.skip("o80 run needs libsystemd to ask RealtimeKit", allow_module_level=True)


@pytest.fixture
def run(segment: str) -> Iterator[Run]:
    """Runs a robot as a user to whom limits refuse real-time priorities."""
    started = contextlib.ExitStack()

    def start(robot: str, *words: str, bus: str) -> Running:
        # root without its capabilities
        drop = ["setpriv", "--securebits=+noroot", "--bounding-set=-all", "--inh-caps=-all"]
        if os.geteuid() != 0:
            drop = []
        elif shutil.which("setpriv") is None:
            pytest.skip("there is no setpriv")
        command = [*drop, O80, "run", robot, "--segment", segment, *words]
        program = Running(
            *command,
            cwd=HERE,
            env={**os.environ, "DBUS_SYSTEM_BUS_ADDRESS": bus},
            preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_RTPRIO, (0, 0)),
        )
        return started.enter_context(program)

    with started:
        yield start


def said_so_far(process: Running) -> str:
    os.set_blocking(process.stderr.fileno(), False)
    text = os.read(process.stderr.fileno(), 1 << 16).decode()
    os.set_blocking(process.stderr.fileno(), True)
    return text


def said_by(process: Running) -> list[str]:
    """Ends a robot in order: what it has said about priorities."""
    process.send_signal(signal.SIGTERM)
    _, text = process.communicate(timeout=WAIT)
    assert process.returncode == 0, text
    return [line for line in text.splitlines() if "priority" in line]


def test_realtime_kit_grants_what_limits_refuse(segment: str, run: Run) -> None:
    if not may_use_fifo():
        pytest.skip("this user may give no real-time priorities")
    with RealtimeKit() as kit:
        process = run("two_joints", "--policy", "fifo", bus=kit.address)
        with o80.Frontend(segment, WAIT) as arm:
            arm.wait_for(5, WAIT)
        assert kit.asked == [(process.pid, 20)]
        assert os.sched_getscheduler(process.pid) == GRANTED
        assert os.sched_getparam(process.pid).sched_priority == 20
        assert resource.prlimit(process.pid, resource.RLIMIT_RTTIME) == (100_000, 200_000)
        (line,) = said_by(process)
    assert "priority 80 was refused (Operation not permitted); RealtimeKit granted 20" in line


def test_a_loop_that_does_not_sleep_loses_the_priority_and_goes_on(segment: str, run: Run) -> None:
    if not may_use_fifo():
        pytest.skip("this user may give no real-time priorities")
    with RealtimeKit() as kit:
        process = run("room_sensor:Spins", "--policy", "rr", "--priority", "7", bus=kit.address)
        with o80.Frontend(segment, WAIT) as room:
            assert room.wait_for(2, WAIT).extended.policy == GRANTED
            assert room.wait_for(5, WAIT).extended.policy == ORDINARY
        assert kit.asked == [(process.pid, 7)]
        text = ""
        while "lost its real-time priority" not in text:
            text += process.stderr.readline()
        said_by(process)


@pytest.mark.parametrize(
    ("mood", "reason"),
    {
        "no bus": "system bus: No such file or directory",
        "rude": "system bus: ",
        "silent": "no answer within 1 s",
        "absent": "no such service",
        "late": "no answer within 1 s",
        "refuses": "not you",
        "agrees": "it agreed, but nothing changed",
    }.items(),
)
def test_a_robot_that_gets_no_priority_says_why_and_runs(
    segment: str, run: Run, mood: str, reason: str
) -> None:
    with RealtimeKit(mood) as kit:
        bus = NOWHERE if mood == "no bus" else kit.address
        process = run("two_joints", "--policy", "fifo", bus=bus)
        with o80.Frontend(segment, WAIT) as arm:
            line = said_so_far(process)  # before the robot runs for others: o80.Robot.start warns
            arm.wait_for(5, WAIT)
        assert os.sched_getscheduler(process.pid) == os.SCHED_OTHER
        assert said_by(process) == []
    assert line.count("priority") == 1
    assert f"; RealtimeKit granted none ({reason}" in line
    assert "--rtprio=99" in line


@pytest.mark.parametrize(
    "words",
    ["two_joints", "two_joints --policy fifo --bursting", "room_sensor:Paced --policy fifo"],
)
def test_a_loop_that_needs_none_or_may_not_sleep_does_not_ask(
    segment: str, run: Run, words: str
) -> None:
    with RealtimeKit() as kit:
        process = run(*words.split(), bus=kit.address)
        o80.Frontend(segment, WAIT).close()
        assert all("RealtimeKit" not in line for line in said_by(process))
        assert kit.callers == 0
