"""Parts that the measuring programs in Python share with those in C++."""

import os
import sys
import time
from collections.abc import Callable
from pathlib import Path


def take_priority() -> None:
    """Keeps ordinary processes out of short measurements, where that is allowed.

    Processes started from here on inherit it.
    """
    try:
        os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(20))
    except PermissionError:
        print("without real-time priority: figures may be noisy", file=sys.stderr)


def sample(name: str, unit: str, value: float) -> None:
    print(name, unit, f"{value:.9g}", sep="\t", flush=True)


def seconds(call: Callable[[], object]) -> float:
    """Time a call takes [s]."""
    begin = time.perf_counter()
    call()
    return time.perf_counter() - begin


def rounds() -> int:
    return int(sys.argv[1])


def built() -> Path:
    """Where the programs and robots were built."""
    return Path(sys.argv[2])
