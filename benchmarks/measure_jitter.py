"""Lateness of a 1 kHz loop beside cyclictest: at once, on one processor, at one priority."""

import os
import subprocess
import time
from collections.abc import Callable, Sequence

from sampling import built, rounds, sample

PROGRAMS = built() / "bin"
PRIORITY = 80
PERIODS = 1000  # in each round


def percentile_99(values: list[int]) -> float:
    return sorted(values)[int(0.99 * (len(values) - 1))] * 1e-3


def cyclictest(processor: int) -> list[int]:
    """Latencies [ns] of one round."""
    ended = subprocess.run(
        ["cyclictest", "-m", "-N", "-v", "-t", "1", "-a", str(processor), "-p", str(PRIORITY),
         "-i", "1000", "-d", "0", "-l", str(PERIODS)],
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    fields = [line.split(":") for line in ended.stdout.splitlines()]
    return [int(line[2]) for line in fields if len(line) == 3 and line[2].strip().isdigit()]


def lateness(segment: str) -> list[int]:
    """Lateness [ns] of as many iterations, of the same second."""
    ended = subprocess.run(
        [PROGRAMS / "o80-bench-lateness", segment, str(PERIODS)],
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    return [int(line) for line in ended.stdout.split()]


Command = Sequence[str | os.PathLike[str]]


def measure(name: str, beside: Callable[[str], Sequence[Command]] = lambda segment: []) -> None:
    """beside: commands of the programs that run meanwhile, by the segment of the loop."""
    processor = max(os.sched_getaffinity(0))
    segment = f"bench-jitter-{os.getpid()}"
    loop: Command = [
        PROGRAMS / "o80-run", "two_joints", "--segment", segment, "--frequency", "1000",
        "--policy", "fifo", "--priority", str(PRIORITY), "--cpus", str(processor),
        "--lock-memory", "--until-eof",
    ]  # fmt: skip
    started = []
    try:
        for command in (loop, *beside(segment)):
            started.append(
                subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL)
            )
            if command is loop:
                time.sleep(0.5)
        for _ in range(min(rounds(), 12)):
            bare = cyclictest(processor)
            sample(f"{name}cyclictest_p99", "us", percentile_99(bare))
            sample(f"{name}loop_lateness_p99", "us", percentile_99(lateness(segment)))
    finally:
        for program in reversed(started):
            program.terminate()
            program.wait()


def main() -> None:
    measure("")


if __name__ == "__main__":
    main()
