"""RealtimeKit: the priority that `o80 run` asks it for, and what it does without one."""

import ctypes
import os
import resource
import shutil
import signal
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from processes import O80, WAIT
from realtime_kit import RealtimeKit

import o80

HERE = Path(__file__).parents[1]
GRANTED = os.SCHED_RR | os.SCHED_RESET_ON_FORK
ORDINARY = os.SCHED_OTHER | os.SCHED_RESET_ON_FORK
NOWHERE = "unix:path=/nowhere"
Run = Callable[..., "subprocess.Popen[str]"]

try:
    ctypes.CDLL("libsystemd.so.0")
except OSError:
    pytest.skip("o80 run needs libsystemd to ask RealtimeKit", allow_module_level=True)


@pytest.fixture
def run(segment: str) -> Iterator[Run]:
    """Runs a robot as a user to whom limits refuse real-time priorities."""
    started: list[subprocess.Popen[str]] = []

    def start(robot: str, *words: str, bus: str) -> "subprocess.Popen[str]":
        # root without its capabilities
        drop = ["setpriv", "--securebits=+noroot", "--bounding-set=-all", "--inh-caps=-all"]
        if os.geteuid() != 0:
            drop = []
        elif shutil.which("setpriv") is None:
            pytest.skip("there is no setpriv")
        started.append(
            subprocess.Popen(
                [*drop, O80, "run", robot, "--segment", segment, *words],
                stdout=subprocess.DEVNULL,
                stderr=subprocess.PIPE,
                text=True,
                cwd=HERE,
                env={**os.environ, "DBUS_SYSTEM_BUS_ADDRESS": bus},
                preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_RTPRIO, (0, 0)),
            )
        )
        return started[0]

    yield start
    for process in started:
        process.kill()
        process.communicate()


def said_so_far(process: "subprocess.Popen[str]") -> str:
    assert process.stderr is not None
    os.set_blocking(process.stderr.fileno(), False)
    text = os.read(process.stderr.fileno(), 1 << 16).decode()
    os.set_blocking(process.stderr.fileno(), True)
    return text


def said_by(process: "subprocess.Popen[str]") -> list[str]:
    """Ends a robot in order: what it has said about priorities."""
    process.send_signal(signal.SIGTERM)
    _, text = process.communicate(timeout=WAIT)
    assert process.returncode == 0, text
    return [line for line in text.splitlines() if "priority" in line]


def may_grant() -> bool:
    """Whether this process may give real-time priorities to others."""
    child = subprocess.Popen(["sleep", "60"])
    try:
        os.sched_setscheduler(child.pid, GRANTED, os.sched_param(20))
    except OSError:
        return False
    finally:
        child.kill()
        child.wait()
    return True


def test_realtime_kit_grants_what_limits_refuse(segment: str, run: Run) -> None:
    if not may_grant():
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
    if not may_grant():
        pytest.skip("this user may give no real-time priorities")
    with RealtimeKit() as kit:
        process = run("room_sensor:Spins", "--policy", "rr", "--priority", "7", bus=kit.address)
        with o80.Frontend(segment, WAIT) as room:
            assert room.wait_for(2, WAIT).extended.policy == GRANTED
            assert room.wait_for(5, WAIT).extended.policy == ORDINARY
        assert kit.asked == [(process.pid, 7)]
        assert process.stderr is not None
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
