"""Runs the program o80, and waits for processes that are not children."""

import os
import select
import subprocess
import sys
from pathlib import Path
from typing import Any

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


def run_o80(*words: object, **options: Any) -> "subprocess.CompletedProcess[str]":
    """Runs the program o80; see run_program()."""
    done = run_program(O80, *words, **options)
    assert "Traceback" not in done.stderr
    return done


def end_of(process: int) -> None:
    """Waits for the end of a process that is not a child."""
    try:
        descriptor = os.pidfd_open(process)
    except ProcessLookupError:
        return
    readable, _, _ = select.select([descriptor], [], [], WAIT)
    os.close(descriptor)
    assert readable
