"""Plays random scripts on every processor (CONTRIBUTING.md).

Each script is a robot and a list of events, generated from a seed. A script that breaks a
promise is shrunk and printed with its seed.
"""

import argparse
import os
import subprocess
import sys

from sources import ROOT

PROGRAM = ROOT / "build" / "dev" / "bin" / "o80_test_scripts"


def start(test: str, **variables: object) -> "subprocess.Popen[bytes]":
    """Starts the test program with environment variables."""
    environment = {**os.environ, **{name: str(value) for name, value in variables.items()}}
    command = [str(PROGRAM), f"--gtest_filter={test}", "--gtest_brief=1"]
    return subprocess.Popen(command, env=environment)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=100_000, help="scripts of each kind")
    parser.add_argument("--seed", type=int, default=0, help="of the first one")
    parser.add_argument("--iterations", type=int, default=480_000, help="beside the reference")
    arguments = parser.parse_args()
    jobs = len(os.sched_getaffinity(0))
    share = -(-arguments.count // jobs)
    running = [
        start(
            "Script.*KeepsEveryPromise",
            O80_SCRIPTS=min(share, arguments.count - job * share),
            O80_SCRIPT_SEED=arguments.seed + job * share,
        )
        for job in range(jobs)
        if job * share < arguments.count
    ]
    failed = [process.wait() for process in running]
    failed.append(start("LinearReference.*", O80_REFERENCE_ITERATIONS=arguments.iterations).wait())
    return int(any(failed))


if __name__ == "__main__":
    sys.exit(main())
