"""Common parts of the measuring programs in Python."""

import os
import sys
import time
from collections.abc import Callable
from pathlib import Path

BUILT = Path(__file__).resolve().parent.parent / "build" / "release"
"""Folder of the built programs and robots."""


def take_priority() -> None:
    """Takes real-time priority for short measurements, where permitted.

    Processes started afterwards inherit the priority.
    """
    try:
        os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(20))
    except PermissionError:
        print("without real-time priority: figures may be noisy", file=sys.stderr)


def sample(name: str, unit: str, value: float) -> None:
    print(name, unit, f"{value:.9g}", sep="\t", flush=True)


def seconds(call: Callable[[], object]) -> float:
    """Measures the duration of a call [s]."""
    begin = time.perf_counter()
    call()
    return time.perf_counter() - begin


def rounds() -> int:
    return int(sys.argv[1])
