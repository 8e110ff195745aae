"""Measurement: how late a robot's loop wakes on this computer, for a short time."""

import os
import time
import warnings
from dataclasses import asdict, dataclass
from typing import Any

from o80.base.errors import Error

POLICIES = {os.SCHED_FIFO: "fifo", os.SCHED_RR: "rr"}


@dataclass(frozen=True)
class WakeUps:
    """Loop of a bundled robot, run as `o80 run` runs it."""

    frequency: float
    seconds: float
    iterations: int = 0
    policy: str = "other"  #: which the kernel granted
    lateness: tuple[float, float, float] = (0.0, 0.0, 0.0)  #: median, 99 %, largest [s]
    overruns: int = 0
    skipped: int = 0
    refused: tuple[str, ...] = ()  #: what the machine refused
    failed: str = ""  #: why nothing was measured

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return asdict(self)

    def __str__(self) -> str:
        if self.failed:
            return f"not measured: {self.failed}"
        median, most, largest = (1e6 * each for each in self.lateness)
        return (
            f"measured: {self.iterations} iterations at {self.frequency:g} Hz ({self.policy}), "
            f"{median:.0f} us late (median), {most:.0f} us (99 %), {largest:.0f} us (largest); "
            f"{self.overruns} were not done in time, {self.skipped} periods were skipped"
        )


def measure(frequency: float, seconds: float, processors: list[int]) -> WakeUps:
    """Runs a simulated robot for so long. Of what fails here, the text says so.

    processors: where its loop runs; empty: anywhere.
    """
    from o80.robots.robot import load

    name = f"doctor-{os.getpid()}"
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        try:
            with load("two_joints").start(
                name, frequency=frequency, policy="fifo", lock_memory=True, cpus=processors or None,
                history=max(1000, min(int(frequency * seconds) + 1, 100_000)),
            ) as process, process.frontend() as frontend:  # fmt: skip
                time.sleep(seconds)
                rows = frontend.history(frontend.published)
                granted = os.sched_getscheduler(process.pid) & ~os.SCHED_RESET_ON_FORK
        except (Error, OSError) as error:
            return WakeUps(frequency, seconds, failed=str(error))
    late = sorted(rows.lateness.tolist()) or [0]
    refused = tuple(str(each.message).partition(": ")[2] for each in said)
    return WakeUps(
        frequency,
        seconds,
        iterations=len(rows),
        policy=POLICIES.get(granted, "other"),
        lateness=(late[len(late) // 2] / 1e9, late[int(len(late) * 0.99)] / 1e9, late[-1] / 1e9),
        overruns=int(rows.overruns[-1]),
        skipped=int(rows.skipped[-1]),
        refused=refused,
    )
