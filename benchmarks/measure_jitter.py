"""Lateness of a 1 kHz loop beside cyclictest: at once, on one processor, at one priority."""

import os
import subprocess

import o80
from sampling import BUILT, rounds, sample

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


def main() -> None:
    processor = max(os.sched_getaffinity(0))
    segment = f"bench-jitter-{os.getpid()}"
    command = [
        str(BUILT / "bin/o80-run"), "two_joints", "--segment", segment, "--frequency", "1000",
        "--policy", "fifo", "--priority", str(PRIORITY), "--cpus", str(processor),
        "--lock-memory", "--until-eof",
    ]  # fmt: skip
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdin=pipe, stdout=subprocess.DEVNULL) as loop:
        with o80.Frontend(segment, read_only=True) as frontend:
            for _ in range(min(rounds(), 12)):
                sample("cyclictest_p99", "us", percentile_99(cyclictest(processor)))
                rows = frontend.history(PERIODS)  # of the same second
                sample("loop_lateness_p99", "us", percentile_99(rows.lateness.tolist()))
        loop.terminate()


if __name__ == "__main__":
    main()
