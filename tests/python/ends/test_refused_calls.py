"""System calls that a sandbox refuses (profiles of containers, gVisor): halts happen all the same.

`python tests/python/ends/test_refused_calls.py` prints the table of all calls.
"""

import collections
import contextlib
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pytest
from processes import O80

import o80

pytestmark = [
    pytest.mark.check,
    pytest.mark.skipif(shutil.which("strace") is None, reason="strace is not installed"),
]
HANGS = 30.0  # [s]
NEVER_REFUSED = ("exit", "exit_group", "getpid", "brk")  # glibc does not expect it
# what o80 makes use of and can do without
NOT_NEEDED = (
    "pidfd_open pidfd_send_signal getrandom sched_getaffinity sched_setaffinity sched_setscheduler "
    "sched_getscheduler sched_yield prctl madvise mbind fstatfs fallocate sysinfo prlimit64 socket "
    "connect clock_nanosleep epoll_create1"
)
# without these nothing can be done: words
NEEDED = [
    ("run", "fcntl"),
    ("run", "clone3"),
    ("run", "link"),
    ("run", "fchmod"),
    ("halt", "mmap"),
    ("halt", "pread64"),
    ("stop", "pidfd_send_signal,kill"),
    ("stop", "getdents64"),
    ("start", "pipe2"),
    ("start", "clock_nanosleep"),
]

SCRIPT = """
import os, sys, o80
bursting = len(sys.argv) > 2
try:
    os.access("/begins", 0)
    with o80.robots.load("two_joints").start(sys.argv[1], bursting=bursting) as robot:
        with robot.frontend() as arm:
            if bursting:
                arm.add_command("elbow", 0.1, iterations=5)
                arm.burst(10)
            arm.halt("text")
            print("halted" if arm.halted else "")
except o80.Error as error:
    print("o80:", error)
    sys.exit(1)
"""
RUN = [Path(o80.prefix(), "bin", "o80-run"), o80.robots.load("two_joints").path, "--frequency=200"]
# words of a program, and the call with which its own work begins
PROGRAMS: dict[str, tuple[list[object], str]] = {
    "run": (RUN, r"fcntl\(0, F_GETFD"),
    "halt": ([O80, "halt"], "o80-refused"),
    "resume": ([O80, "resume"], "o80-refused"),
    "stop": ([O80, "stop"], "/dev/shm"),
    "list": ([O80, "list"], "/dev/shm"),
    "start": ([sys.executable, "-c", SCRIPT], "/begins"),
    "burst": ([sys.executable, "-c", SCRIPT], "/begins"),
}
NAME = "refused"


def command(program: str) -> list[str]:
    words = [*PROGRAMS[program][0]]
    words += {"run": [f"--segment={NAME}"], "list": [], "burst": [NAME, "b"]}.get(program, [NAME])
    return [*map(str, words)]


class Robot:
    """A robot that no call is refused to, in the place of a program that is one."""

    def __init__(self, program: str) -> None:
        self.process = None
        if program in ("halt", "resume", "stop", "list"):
            self.process = o80.robots.load("two_joints").start(NAME, frequency=200)
        if program == "resume":
            o80.halt(NAME, "text")

    def __enter__(self) -> "Robot":
        return self

    def __exit__(self, *_: object) -> None:
        if self.process is not None:
            self.process.stop()
        if any(entry.name == NAME for entry in o80.segments()):
            o80.clean(NAME)


def calls_of(program: str) -> dict[str, int]:
    """Calls that a program makes in its own work, and how often it made each before."""
    begin = re.compile(PROGRAMS[program][1])
    before: collections.Counter[str] = collections.Counter()
    later: set[str] = set()
    begun = False
    with Robot(program), tempfile.NamedTemporaryFile("r") as log:
        traced = subprocess.Popen(
            ["strace", "-f", "-qq", "-o", log.name, *command(program)], stdout=subprocess.DEVNULL
        )
        if program == "run":
            with o80.Frontend(NAME, timeout=HANGS) as arm:
                arm.halt("text")
                arm.wait_for(arm.published + 50)
                o80.stop(NAME)
        assert traced.wait(HANGS) == 0
        for line in log:
            begun = begun or begin.search(line) is not None
            if found := re.match(r"\d+ +(\w+)\(", line):
                if begun:
                    later.add(found[1])
                else:
                    before[found[1]] += 1
    assert begun
    return {call: before[call] for call in sorted(later) if call not in NEVER_REFUSED}


def outcome(program: str, call: str, error: str, first: int) -> tuple[bool, str]:
    """Whether it acted, and what it said. The call is refused from its `first` time on."""
    inject = f"inject={call}:error={error}:when={first}+"
    traced = ["strace", "-f", "-qq", "-o", "/dev/null", "-e", f"trace={call}", "-e", inject]
    with Robot(program), tempfile.TemporaryFile() as output:
        child = subprocess.Popen(
            [*traced, *command(program)],
            stdout=output,
            stderr=output,
            start_new_session=True,
            cwd=tempfile.gettempdir(),
        )
        acted = False
        try:
            if program == "run":
                acted = halts(child)
            code = child.wait(HANGS)
        except subprocess.TimeoutExpired:
            code = None
        finally:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(child.pid, signal.SIGKILL)
        output.seek(0)
        said = output.read().decode(errors="replace")
        if program == "halt":
            with o80.Frontend(NAME) as arm:
                acted = arm.halted is not None
        elif program == "resume":
            with o80.Frontend(NAME) as arm:
                acted = arm.halted is None
        elif program == "stop":
            acted = not any(entry.name == NAME and entry.alive for entry in o80.segments())
        elif program == "list":
            acted = NAME in said
        elif program != "run":
            acted = "halted" in said.splitlines()
    lines = said.strip().splitlines()
    words = lines[-1] if lines else ""
    if code is None:
        words = "HANGS " + words
    elif code < 0 or code > 128:
        words = f"SIGNAL {code} " + words
    elif "Traceback" in said:
        words = "TRACEBACK " + words
    elif not acted and (code == 0 or not words):
        words = f"SILENT {code} " + words
    return acted, words


def halts(child: "subprocess.Popen[bytes]") -> bool:
    """Whether a robot that has started halts; it is stopped then."""
    end = time.monotonic() + HANGS / 3
    while child.poll() is None and time.monotonic() < end:
        if any(entry.name == NAME and entry.life == "running" for entry in o80.segments()):
            with o80.Frontend(NAME) as arm:
                arm.halt("text")
                while (halt := arm.halted) is None or halt.iteration is None:
                    if time.monotonic() > end:
                        return False
                    time.sleep(0.01)
            children = Path(f"/proc/{child.pid}/task/{child.pid}/children")
            os.kill(int(children.read_text().split()[0]), signal.SIGTERM)
            return True
        time.sleep(0.01)
    return False


@pytest.mark.parametrize("error", ["EPERM", "ENOSYS"])
@pytest.mark.parametrize("program", PROGRAMS)
def test_calls_that_are_not_needed_hinder_nothing(program: str, error: str) -> None:
    calls = NOT_NEEDED
    if program in ("start", "burst"):  # time.sleep of the starting process
        calls = calls.replace("clock_nanosleep ", "")
    acted, words = outcome(program, calls.replace(" ", ","), error, 1)
    assert acted, words
    assert not re.match("HANGS|SIGNAL|TRACEBACK", words)


@pytest.mark.parametrize(("program", "call"), NEEDED)
def test_a_needed_call_is_refused_with_words(program: str, call: str) -> None:
    acted, words = outcome(program, call, "EPERM", calls_of(program).get(call, 0) + 1)
    assert not acted
    assert words.startswith("o80: ")
    assert "Operation not permitted" in words


def main() -> None:
    for program in sys.argv[1:] or PROGRAMS:
        for call, before in calls_of(program).items():
            for error in ("EPERM", "ENOSYS"):
                acted, words = outcome(program, call, error, before + 1)
                print(
                    program,
                    call,
                    error,
                    "acts" if acted else "refused",
                    words[:230],
                    sep=" | ",
                    flush=True,
                )


if __name__ == "__main__":
    main()
