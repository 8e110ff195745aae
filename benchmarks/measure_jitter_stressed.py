"""The lateness of measure_jitter.py on a machine under stress.

Every processor computes, moves memory and switches, and 64 processes wait for every row of the
loop and read the newest one too.
"""

import os
from collections.abc import Sequence

from measure_jitter import PROGRAMS, Command, measure

READERS = 64
LONGEST = 300  # whatever becomes of this process [s]


def beside(segment: str) -> Sequence[Command]:
    """stress-ng and the readers."""
    processors = str(len(os.sched_getaffinity(0)))
    stress: Command = [
        "stress-ng", "--quiet", "--cpu", processors, "--vm", "1", "--vm-bytes", "64M",
        "--pipe", "1", "--sock", "1", "--switch", "1", "--timeout", str(LONGEST),
    ]  # fmt: skip
    reader: Command = [PROGRAMS / "o80-bench-reader", segment]
    return [stress, *[reader] * READERS]


if __name__ == "__main__":
    measure("stressed_", beside)
