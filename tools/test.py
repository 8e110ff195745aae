"""Runs all tests, or the steps named on the command line, and stops at the first that fails.

What a step prints goes to build/test/<step>.log; its closing lines are shown, and all of it when
it fails.
"""

import argparse
import os
import subprocess
import sys
import time
from collections import deque
from pathlib import Path

from sources import ROOT

JOBS = str(len(os.sched_getaffinity(0)))
LOGS = ROOT / "build" / "test"


def typed_folders() -> list[str]:
    """Folders outside the package whose Python is type-checked too."""
    folders = ("tools", "benchmarks", "examples", "tests/proofs")
    return [folder for folder in folders if any((ROOT / folder).rglob("*.py"))]


def cpp(preset: str) -> list[list[str]]:
    """Commands that build a preset and run its tests."""
    # a thread sanitizer of this age cannot stand the widest address randomisation
    random_bits = int(Path("/proc/sys/vm/mmap_rnd_bits").read_text())
    fixed_addresses = ["setarch", "-R"] if preset == "tsan" and random_bits > 28 else []
    return [
        ["cmake", "--preset", preset],
        ["cmake", "--build", "--preset", preset, "-j", JOBS],
        [*fixed_addresses, "ctest", "--preset", preset, "-j", JOBS],
    ]


PYTHON = [sys.executable, "-m"]
PROOF = [sys.executable, "tests/proofs/run.py"]
PACKAGES = ["-p", "o80", "-p", "o80_mujoco", "-p", "o80_pam", "-p", "o80_table_tennis"]
STEPS: dict[str, list[list[str]]] = {
    "format": [[sys.executable, "tools/format.py", "--check"]],
    "ruff": [["ruff", "check", "."]],
    "mypy": [
        [*PYTHON, "mypy", *PACKAGES],
        *([*PYTHON, "mypy", folder] for folder in typed_folders()),
    ],
    "dev": cpp("dev"),
    "torture": [
        # chance is the machine's; the mixes are the same in every run
        [
            "build/dev/bin/o80-torture",
            "--kills",
            "2000",
            "--halts",
            "300",
            "--seed",
            "77",
            "--python",
            sys.executable,
        ]
    ],
    "tidy": [[sys.executable, "tools/tidy.py"]],
    "models": [[*PROOF, "models"]],
    "asan": cpp("asan"),
    "tsan": cpp("tsan"),
    "fuzz": [[*PROOF, "fuzz"]],
    "rt": [[*PROOF, "real_time", "--short"]],
    "arm64": cpp("arm64"),
    "pytest": [[*PYTHON, "pytest"]],
}
ON_DEMAND = {"arm64"}  # an emulator's minutes
CLOSING_LINES = {"dev": 3, "asan": 3, "tsan": 3, "arm64": 3}


def run(name: str) -> bool:
    """Runs one step; says how it went."""
    log = LOGS / f"{name}.log"
    print(f"== {name}", flush=True)
    begin = time.monotonic()
    with log.open("w") as output:
        for command in STEPS[name]:
            result = subprocess.run(command, cwd=ROOT, stdout=output, stderr=subprocess.STDOUT)
            if result.returncode != 0:
                break
    passed = result.returncode == 0
    with log.open(errors="replace") as text:
        print(*deque(text, CLOSING_LINES.get(name, 1) if passed else 400), sep="", end="")
    seconds = time.monotonic() - begin
    print(f"== {name}: {'passed' if passed else 'FAILED'} in {seconds:.0f} s", flush=True)
    return passed


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    what = f"of {', '.join(STEPS)}; by default all but {', '.join(ON_DEMAND)}"
    parser.add_argument("steps", nargs="*", help=what)
    parser.add_argument("--keep-going", action="store_true", help="run the steps after a failure")
    arguments = parser.parse_args()
    unknown = set(arguments.steps) - set(STEPS)
    if unknown:
        parser.error(f"no step {', '.join(sorted(unknown))}; there are {', '.join(STEPS)}")

    tools = Path(sys.executable).parent
    os.environ["PATH"] = f"{tools}{os.pathsep}{os.environ['PATH']}"
    os.environ.setdefault("CCACHE_DIR", str(ROOT / "build" / "ccache"))
    os.environ.setdefault("CCACHE_NOHASHDIR", "1")  # presets share what they compile alike
    LOGS.mkdir(parents=True, exist_ok=True)
    failed = []
    for name in arguments.steps or [name for name in STEPS if name not in ON_DEMAND]:
        if not run(name):
            failed.append(name)
            if not arguments.keep_going:
                break
    print(f"failed: {', '.join(failed)} (build/test)" if failed else "all steps passed")
    return int(bool(failed))


if __name__ == "__main__":
    sys.exit(main())
