"""Costs of a process at first: imports of o80 and NumPy, and o80 list."""

import subprocess
import sys
import tempfile
from pathlib import Path

from sampling import rounds, sample, seconds, take_priority

O80 = Path(sys.executable).with_name("o80")
IMPORT = """
import time
begin = time.perf_counter()
import {}
print(time.perf_counter() - begin)
"""


def importing(module: str) -> float:
    """Time in a fresh interpreter [ms]."""
    command = [sys.executable, "-c", IMPORT.format(module)]
    ended = subprocess.run(command, capture_output=True, text=True, check=True)
    return float(ended.stdout) * 1e3


def listing(folder: str) -> None:
    """The whole command, where there is no segment."""
    environment = {"O80_DIRECTORY": folder, "PATH": str(O80.parent)}
    subprocess.run([O80, "list"], env=environment, capture_output=True, check=True)


def main() -> None:
    take_priority()
    with tempfile.TemporaryDirectory() as folder:
        for _ in range(min(rounds(), 12)):
            sample("import_numpy", "ms", importing("numpy"))
            # with Frontend, which needs NumPy: `import o80` alone leaves that to its first use
            sample("import_o80", "ms", importing("o80.frontend.frontend"))
            sample("o80_list", "s", seconds(lambda: listing(folder)))


if __name__ == "__main__":
    main()
