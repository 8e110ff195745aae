"""o80 top: the list, live."""

import contextlib
import os
import pty
import signal
import subprocess
import sys
from pathlib import Path

import pytest

import o80

O80 = str(Path(sys.executable).parent / "o80")
WAIT = 60.0  # [s] longer than any command should take


def test_each_look_is_a_list_of_its_own(arm: o80.Frontend) -> None:
    command = [O80, "top", "--interval", "0.01", "--count", "3"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=WAIT)

    assert done.returncode == 0
    assert done.stdout.count(arm.segment) == 3
    assert done.stdout.count("last row") == 3
    assert "\033[" not in done.stdout


def read_to_the_end(terminal: int) -> str:
    seen = ""
    with contextlib.suppress(OSError):  # the end of a terminal is an error
        while part := os.read(terminal, 4096):
            seen += part.decode()
    return seen


def test_on_a_terminal_the_screen_is_restored_after_an_interrupt(
    process: o80.robots.Process,
) -> None:
    ours, theirs = pty.openpty()
    top = subprocess.Popen([O80, "top", "--interval", "0.05"], stdout=theirs, stderr=theirs)
    os.close(theirs)
    seen = ""
    while seen.count("last row") < 2:
        seen += os.read(ours, 4096).decode()
    top.send_signal(signal.SIGINT)
    seen += read_to_the_end(ours)
    assert top.wait(timeout=WAIT) == 130
    os.close(ours)

    assert seen.startswith("\033[?1049h")
    assert seen.rstrip().endswith("\033[?1049l\033[?25h")
    assert process.segment in seen


@pytest.mark.parametrize("interval", ["0", "-1", "nan"])
def test_an_interval_that_cannot_be_is_refused(interval: str) -> None:
    done = subprocess.run([O80, "top", "--interval", interval], capture_output=True, text=True)

    assert done.returncode == 2
    assert "interval must be positive" in done.stderr
