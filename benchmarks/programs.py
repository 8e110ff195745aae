"""The programs that measure, and their samples.

Each prints a line a sample: name, unit, value, with tabs between. The first argument is how often
each measurement is repeated, alternating with its baseline.
"""

import statistics
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
LONGEST = 300  # of one program [s]


class NotMeasuredError(Exception):
    """Why a program gave no figures."""


@dataclass
class Samples:
    """All values of one name."""

    unit: str
    values: list[float] = field(default_factory=list)

    @property
    def median(self) -> float:
        return statistics.median(self.values)


def command_of(program: str, rounds: int, built: Path) -> list[str]:
    """Command that runs the program of a row."""
    python = ROOT / "benchmarks" / f"measure_{program.replace('-', '_')}.py"
    if python.exists():
        return [sys.executable, str(python), str(rounds), str(built)]
    compiled = built / "bin" / f"o80-bench-{program}"
    if not compiled.exists():
        raise NotMeasuredError(f"{compiled.name} is not built")
    paths = [str(built / "bin" / "o80-run"), "two_joints"] if program == "start" else []
    return [str(compiled), str(rounds), *paths]


def last_words(text: str) -> str:
    lines = [line for line in text.strip().splitlines() if line.strip()]
    return lines[-1].strip() if lines else "it said nothing"


def run(program: str, rounds: int, built: Path) -> dict[str, Samples]:
    """Runs a program to its end. Raises NotMeasuredError."""
    try:
        ended = subprocess.run(
            command_of(program, rounds, built), capture_output=True, text=True, timeout=LONGEST
        )
    except subprocess.TimeoutExpired:
        raise NotMeasuredError(f"'{program}' took longer than {LONGEST} s") from None
    samples: dict[str, Samples] = {}
    for line in ended.stdout.splitlines():
        name, unit, value = line.split("\t")
        samples.setdefault(name, Samples(unit)).values.append(float(value))
    if ended.returncode != 0 and not samples:
        raise NotMeasuredError(last_words(ended.stderr))
    if ended.returncode != 0:
        print(f"{program} failed: {last_words(ended.stderr)}", file=sys.stderr)
    return samples
