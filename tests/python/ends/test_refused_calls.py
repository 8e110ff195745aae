"""System calls that a sandbox refuses (containers, gVisor): halts happen all the same."""

import contextlib
import os
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
# what o80 makes use of and can do without
NOT_NEEDED = (
    "pidfd_open pidfd_send_signal getrandom sched_getaffinity sched_setaffinity sched_setscheduler "
    "sched_getscheduler sched_yield prctl madvise mbind fstatfs fallocate sysinfo prlimit64 socket "
    "connect clock_nanosleep epoll_create1"
)
SCRIPT = """
import os, sys, o80
bursting = len(sys.argv) > 2
try:
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
PROGRAMS: dict[str, list[object]] = {
    "run": RUN,
    "halt": [O80, "halt"],
    "resume": [O80, "resume"],
    "stop": [O80, "stop"],
    "list": [O80, "list"],
    "start": [sys.executable, "-c", SCRIPT],
    "burst": [sys.executable, "-c", SCRIPT],
}
NAME = "refused"


def command(program: str) -> list[str]:
    words = [*PROGRAMS[program]]
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


def acted(program: str, said: str) -> bool:
    """Whether a program has done what it is for."""
    if program in ("halt", "resume"):
        with o80.Frontend(NAME) as arm:
            return (arm.halted is not None) == (program == "halt")
    if program == "stop":
        return not any(entry.name == NAME and entry.alive for entry in o80.segments())
    return NAME in said if program == "list" else "halted" in said.splitlines()


@pytest.mark.parametrize("error", ["EPERM", "ENOSYS"])
@pytest.mark.parametrize("program", PROGRAMS)
def test_calls_that_are_not_needed_hinder_nothing(program: str, error: str) -> None:
    calls = NOT_NEEDED
    if program in ("start", "burst"):  # time.sleep of the starting process
        calls = calls.replace("clock_nanosleep ", "")
    calls = calls.replace(" ", ",")
    refuse = ["-e", f"trace={calls}", "-e", f"inject={calls}:error={error}"]
    with Robot(program), tempfile.TemporaryFile() as output:
        child = subprocess.Popen(
            ["strace", "-f", "-qq", "-o", "/dev/null", *refuse, *command(program)],
            stdout=output,
            stderr=output,
            start_new_session=True,
            cwd=tempfile.gettempdir(),
        )
        try:
            assert program != "run" or halts(child)
            code = child.wait(HANGS)
        finally:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(child.pid, signal.SIGKILL)
        output.seek(0)
        said = output.read().decode(errors="replace")
        assert 0 <= code <= 128, said
        assert "Traceback" not in said
        assert program == "run" or acted(program, said), said
