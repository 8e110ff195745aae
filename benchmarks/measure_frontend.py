"""The calls of a Python frontend."""

import ctypes
import time
from collections.abc import Callable
from timeit import timeit

import numpy as np
from numpy.typing import NDArray

import o80
from sampling import BUILT, rounds, sample, seconds, take_priority

ROWS = 10_000
CALLS = 2000
COMMANDS = 1000
HISTORIES = 5  # in a round
CALLED = {
    "python_burst_1": "arm.burst(1)",
    "python_latest": "arm.latest()",
    "python_observed": "arm.latest().observed",
}


def start_robot() -> None:
    """From the start of a robot's process to its first row, and another frontend's attachment."""
    robot = o80.robots.load("two_joints")
    begin = time.perf_counter()
    with robot.start(bursting=True) as process, process.frontend() as arm:
        arm.latest()
        sample("python_backend_ready", "ms", (time.perf_counter() - begin) * 1e3)
        begin = time.perf_counter()
        with o80.Frontend(arm.segment):
            sample("python_frontend_attached", "ms", (time.perf_counter() - begin) * 1e3)


def command(arm: o80.Frontend) -> None:
    """Commands added, sent, and dropped again by the backend before the next round."""
    added = timeit("arm.add_command(0, 0.5, duration=2.0)", number=COMMANDS, globals={"arm": arm})
    sample("python_add_command", "us", added / COMMANDS * 1e6)
    sample("python_pulse_1000", "us", seconds(arm.pulse) * 1e6)
    arm.purge().wait(5.0)


def read(arm: o80.Frontend) -> None:
    for name, statement in CALLED.items():
        taken = timeit(statement, number=CALLS, globals={"arm": arm})
        sample(name, "us", taken / CALLS * 1e6)

    # in turn, after the first pages were touched
    rows = arm.history(ROWS).rows
    target = np.ones_like(rows)
    pointers = (target.ctypes.data, rows.ctypes.data)
    calls: dict[str, Callable[[], object]] = {
        "memcpy_same_bytes": lambda: ctypes.memmove(*pointers, rows.nbytes),
        "python_history": lambda: arm.history(ROWS),
        "numpy_column": lambda: rows["observed"].copy(),
        "python_column": lambda: arm.history(ROWS, fields="observed"),
    }
    for call in calls.values():
        call()
    for _ in range(HISTORIES):
        for name, call in calls.items():
            sample(name, "us", seconds(call) * 1e6)


def follow_trajectory(arm: o80.Frontend, targets: NDArray[np.float64]) -> None:
    def send() -> None:
        arm.add_trajectory(targets, iterations=1)
        arm.pulse()

    sample("python_trajectory", "ms", seconds(send) * 1e3)
    arm.purge().wait(5.0)


def main() -> None:
    take_priority()
    for _ in range(min(rounds(), 7)):
        start_robot()
    two = o80.robots.load("two_joints").start(bursting=True)
    eight = o80.robots.load(str(BUILT / "lib" / "o80" / "robots" / "eight_empty.so")).start(
        bursting=True
    )
    targets = np.random.default_rng(1).random((ROWS, 8))
    with two, two.frontend() as arm, eight, eight.frontend() as many:
        arm.burst(ROWS + 10)
        for _ in range(rounds()):
            read(arm)
            command(arm)
            follow_trajectory(many, targets)


if __name__ == "__main__":
    main()
