"""Runs programs, o80 among them, and waits for processes that are not children."""

import os
import select
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import IO, Any, TypeVar

Found = TypeVar("Found")

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = (
    *("python/o80", "devices/o80_devices", "gateways/ros2/o80_ros2", "robots/arms/python"),
    *("robots/pam/python", "simulators/mujoco/python", "apps/table_tennis/o80_table_tennis"),
)
PRODUCT = [file for package in PACKAGES for file in (ROOT / package).rglob("*.py")]
WAIT = 60.0  # longer than any end may take [s]
O80 = str(Path(sys.executable).parent / "o80")


def run_program(
    *words: object, code: int | None = 0, timeout: float = WAIT, **options: Any
) -> "subprocess.CompletedProcess[str]":
    """Runs a program, which must end with this code; None: any code."""
    command = [*map(str, words)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=timeout, **options)
    assert code in (None, done.returncode), done.stdout + done.stderr
    return done


def run_python(*words: object, **options: Any) -> "subprocess.CompletedProcess[str]":
    """Runs an interpreter with these words; see run_program()."""
    return run_program(sys.executable, *words, **options)


def may_use_fifo() -> bool:
    """Whether this user may give processes real-time priorities."""
    tries = "import os; os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(50))"
    return run_python("-c", tries, code=None).returncode == 0


def run_o80(*words: object, **options: Any) -> "subprocess.CompletedProcess[str]":
    """Runs the program o80; see run_program()."""
    done = run_program(O80, *words, **options)
    assert "Traceback" not in done.stderr
    return done


def o80_says(*words: object, **options: Any) -> str:
    """Returns output and errors of the program o80; see run_program()."""
    done = run_o80(*words, **options)
    return done.stdout + done.stderr


class Running(subprocess.Popen[str]):
    """A program with pipes, unless options say otherwise; the end of its block kills it."""

    stdin: IO[str]
    stdout: IO[str]
    stderr: IO[str]

    def __init__(self, *words: object, **options: Any) -> None:
        pipes = dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.PIPE)
        super().__init__([*map(str, words)], **pipes | {"text": True} | options)

    def __exit__(self, *_: object) -> None:
        self.kill()
        super().__exit__(None, None, None)


def until(told: Callable[[], Found]) -> Found:
    """Asks again and again; returns the first answer that is true."""
    end = time.monotonic() + WAIT
    while not (answer := told()):
        assert time.monotonic() < end
        time.sleep(0.001)
    return answer


def end_of(process: int) -> None:
    """Waits for the end of a process that is not a child."""
    try:
        descriptor = os.pidfd_open(process)
    except ProcessLookupError:
        return
    readable, _, _ = select.select([descriptor], [], [], WAIT)
    os.close(descriptor)
    assert readable
