"""Lateness of a 1 kHz loop beside cyclictest: at once, on one processor, at one priority."""

import os
import subprocess
import time

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


def main() -> None:
    processor = max(os.sched_getaffinity(0))
    segment = f"bench-jitter-{os.getpid()}"
    loop = subprocess.Popen(
        [PROGRAMS / "o80-run", "two_joints", "--segment", segment, "--frequency", "1000",
         "--policy", "fifo", "--priority", str(PRIORITY), "--cpus", str(processor),
         "--lock-memory", "--until-eof"],
        stdin=subprocess.PIPE, stdout=subprocess.DEVNULL,
    )  # fmt: skip
    try:
        time.sleep(0.5)
        for _ in range(min(rounds(), 12)):
            bare = cyclictest(processor)
            sample("cyclictest_p99", "us", percentile_99(bare))
            sample("loop_lateness_p99", "us", percentile_99(lateness(segment)))
    finally:
        loop.terminate()
        loop.wait()


if __name__ == "__main__":
    main()
