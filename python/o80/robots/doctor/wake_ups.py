"""Measures how late a robot's loop and its reader wake on this computer, for a short time."""

import os
import time
import warnings
from dataclasses import dataclass

from o80.base.errors import Error, TimeoutError
from o80.frontend.frontend import Frontend
from o80.frontend.segments import segments
from o80.robots.doctor.load import load

POLICIES = {os.SCHED_FIFO: "fifo", os.SCHED_RR: "rr"}
Spread = tuple[float, float, float]  # median, 99 %, largest [s]


@dataclass(frozen=True)
class WakeUps:
    """Delays of a bundled robot's loop, run as by `o80 run`, and of a reader of its rows."""

    frequency: float
    seconds: float
    iterations: int = 0
    policy: str = "other"  #: policy that the kernel granted
    lateness: Spread = (0.0, 0.0, 0.0)
    reader: Spread = (0.0, 0.0, 0.0)  #: time from a row until the reader has it
    overruns: int = 0
    skipped: int = 0
    refused: tuple[str, ...] = ()  #: texts about settings that the machine refused
    failed: str = ""  #: why nothing was measured

    def __str__(self) -> str:
        if self.failed:
            return f"not measured: {self.failed}"
        return (
            f"{self.iterations} iterations at {self.frequency:g} Hz ({self.policy}), "
            f"not done in time: {self.overruns}, periods skipped: {self.skipped}\n"
            f"   the loop woke late by {_text(self.lateness)}\n"
            f"   a reader had the row after {_text(self.reader)}"
        )


def measure(frequency: float, seconds: float, processors: list[int]) -> WakeUps:
    """Runs a simulated robot for `seconds`. If that fails, `failed` has the reason.

    processors: processors of its loop; empty: any.
    """
    from o80.robots.robot import load as load_robot

    name = f"doctor-{os.getpid()}"
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        try:
            with load_robot("two_joints").start(
                name, frequency=frequency, policy="fifo", lock_memory=True, cpus=processors or None,
                history=max(1000, min(int(frequency * seconds) + 1, 100_000)),
            ) as process, process.frontend() as frontend:  # fmt: skip
                reader = _read(frontend, seconds)
                rows = frontend.history(frontend.published)
                granted = os.sched_getscheduler(process.pid) & ~os.SCHED_RESET_ON_FORK
        except (Error, OSError) as error:
            return WakeUps(frequency, seconds, failed=str(error))
    if len(rows) == 0:
        failed = f"no iteration at {frequency:g} Hz ended within {seconds:g} s: raise --seconds"
        return WakeUps(frequency, seconds, failed=failed)
    return WakeUps(
        frequency,
        seconds,
        iterations=int(rows.iteration[-1]),
        policy=POLICIES.get(granted, "other"),
        lateness=_spread(rows.lateness.tolist()),
        reader=_spread(reader),
        overruns=int(rows.overruns[-1]),
        skipped=int(rows.skipped[-1]),
        refused=tuple(str(each.message).partition(": ")[2] for each in said),
    )


def measure_beside_load(frequency: float, seconds: float, processors: list[int]) -> WakeUps:
    """Measures beside a load, unless a robot runs here, which the load would disturb."""
    # a segment that this user may not read counts too
    for entry in segments():
        if entry.alive or entry.life == "unknown":
            runs = "runs" if entry.alive else "may run"
            reason = f"'{entry.name}' {runs} on this computer, and a load would disturb it"
            return WakeUps(frequency, seconds, failed=reason)
    try:
        with load():
            return measure(frequency, seconds, processors)
    except OSError as error:
        return WakeUps(frequency, seconds, failed=str(error))


def _read(frontend: Frontend, seconds: float) -> list[int]:
    """Waits for rows and returns their ages on arrival [ns]."""
    ages = []
    end = time.monotonic() + seconds
    while (left := end - time.monotonic()) > 0:
        try:
            row = frontend.wait_for(frontend.published + 1, left)
        except TimeoutError:
            break
        ages.append(time.monotonic_ns() - row.time)
    return ages


def _text(spread: Spread) -> str:
    median, most, largest = (f"{1e6 * each:.0f} us" for each in spread)
    return f"{median} (median), {most} (99 %), {largest} (largest)"


def _spread(times: list[int]) -> Spread:
    late = sorted(times) or [0]
    return late[len(late) // 2] / 1e9, late[int(len(late) * 0.99)] / 1e9, late[-1] / 1e9
