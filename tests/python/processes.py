"""The program o80, and processes that are not our children."""

import os
import select
import subprocess
import sys
from pathlib import Path
from typing import Any

WAIT = 60.0  # [s] longer than any end should take
O80 = str(Path(sys.executable).parent / "o80")


def run_o80(*words: object, code: int = 0, **options: Any) -> "subprocess.CompletedProcess[str]":
    """Runs the program o80, which must end with this code."""
    command = [O80, *map(str, words)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=WAIT, **options)
    assert done.returncode == code, done.stdout + done.stderr
    assert "Traceback" not in done.stderr
    return done


def end_of(process: int) -> None:
    """Waits until a process that is not our child has ended."""
    try:
        descriptor = os.pidfd_open(process)
    except ProcessLookupError:
        return
    readable, _, _ = select.select([descriptor], [], [], WAIT)
    os.close(descriptor)
    assert readable
