"""Costs of a process at first: imports of o80 and NumPy, a first attach, and o80 list."""

import os
import subprocess
import sys
import tempfile
from pathlib import Path

import o80
from sampling import rounds, sample, seconds, take_priority

O80 = Path(sys.executable).with_name("o80")
IMPORT = """
import time
begin = time.perf_counter()
import {}
print(time.perf_counter() - begin)
"""


ATTACH = """
import sys, time, o80
begin = time.perf_counter()
o80.Frontend(sys.argv[1]).latest()
print(time.perf_counter() - begin)
"""
ON_TOP = 10.0
"""Time on top of `import numpy` for a first attach [ms]."""


def timed(program: str, *words: str) -> float:
    """Time that a program prints in a fresh interpreter [s], in ms."""
    command = [sys.executable, "-c", program, *words]
    ended = subprocess.run(command, capture_output=True, text=True, check=True)
    return float(ended.stdout) * 1e3


def importing(module: str) -> float:
    """Time in a fresh interpreter [ms]."""
    return timed(IMPORT.format(module))


def listing(folder: str) -> None:
    """The whole command, where there is no segment."""
    environment = {"O80_DIRECTORY": folder, "PATH": str(O80.parent)}
    subprocess.run([O80, "list"], env=environment, capture_output=True, check=True)


def main() -> None:
    take_priority()
    segment = f"attach-{os.getpid()}"
    with tempfile.TemporaryDirectory() as folder, o80.Backend(segment, ["joint"]) as backend:
        backend.publish([0.0])
        for _ in range(min(rounds(), 12)):
            numpy = importing("numpy")
            sample("import_numpy", "ms", numpy)
            sample("import_numpy_and_10_ms", "ms", numpy + ON_TOP)
            sample("first_attach", "ms", timed(ATTACH, segment))
            # with Frontend, which needs NumPy: `import o80` alone leaves that to its first use
            sample("import_o80", "ms", importing("o80.frontend.frontend"))
            sample("o80_list", "s", seconds(lambda: listing(folder)))


if __name__ == "__main__":
    main()
