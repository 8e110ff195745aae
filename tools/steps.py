"""Steps of `make test` and `make check`: commands, logs and summaries."""

import os
import re
import subprocess
import sys
import time
from collections import deque
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from sources import ROOT

BEGIN = time.monotonic()
JOBS = len(os.sched_getaffinity(0))
LOGS = ROOT / "build" / "test"
PYTHON = [sys.executable, "-m"]
CLOSING = re.compile(  # closing lines of ctest and pytest
    r"^\d+% tests passed|^Total Test time|^left to make check|^left out"
    r"|^=+ .*\b(passed|skipped|deselected)\b.* =+$"
)


@dataclass(frozen=True)
class Step:
    """Commands of a step, run in order until one fails."""

    name: str
    commands: list[list[str]]

    @property
    def log(self) -> Path:
        return LOGS / f"{self.name}.log"

    def lines(self) -> list[str]:
        """Returns the closing lines of ctest or pytest in the log, else the last line."""
        with self.log.open(errors="replace") as text:
            return [line for line in text if CLOSING.search(line)] or self.last_lines(1)

    def last_lines(self, count: int) -> list[str]:
        with self.log.open(errors="replace") as text:
            return list(deque(text, count))


def use_tools() -> None:
    """Puts the environment's tools first in the path, and creates the folder of logs."""
    tools = Path(sys.executable).parent
    os.environ["PATH"] = f"{tools}{os.pathsep}{os.environ['PATH']}"
    os.environ.setdefault("CCACHE_DIR", str(ROOT / "build" / "ccache"))
    # presets share equal compilations
    os.environ.setdefault("CCACHE_NOHASHDIR", "1")
    os.environ.setdefault("CCACHE_BASEDIR", str(ROOT))
    os.environ.setdefault("CCACHE_ABSSTDERR", "1")  # errors show absolute paths
    LOGS.mkdir(parents=True, exist_ok=True)


def times() -> str:
    """Text of the time since the start, and of the processor time of all ended programs."""
    used = os.times()
    processor = used.children_user + used.children_system
    return f"{time.monotonic() - BEGIN:.0f} s ({processor:.0f} s of processor time)"


def run(step: Step) -> bool:
    """Runs a step; prints its closing lines, or most of its log after a failure."""
    begin, used = time.monotonic(), 0.0
    print(f"== {begin - BEGIN:3.0f} s: {step.name}", flush=True)
    returned = 0
    with step.log.open("w") as output:
        for command in step.commands:
            process = subprocess.Popen(command, cwd=ROOT, stdout=output, stderr=subprocess.STDOUT)
            _, status, usage = os.wait4(process.pid, 0)
            returned = process.returncode = os.waitstatus_to_exitcode(status)
            used += usage.ru_utime + usage.ru_stime
            if returned != 0:
                break
    now = time.monotonic()
    verdict = "passed" if returned == 0 else f"FAILED ({step.log.relative_to(ROOT)})"
    shown = step.lines() if returned == 0 else step.last_lines(400)
    took = f"{now - begin:.0f} s ({used:.0f} s of processor time)"
    text = f"{''.join(shown)}== {now - BEGIN:3.0f} s: {step.name}: {verdict} in {took}"
    print(text, flush=True)
    return returned == 0


def run_beside(chains: Iterable[list[Step]], lanes: int, *, keep_going: bool = False) -> set[str]:
    """Runs up to `lanes` chains of steps at the same time; returns the names of failed steps.

    The steps of a chain run one after the other. After a failure no further step begins, unless
    `keep_going` is set.
    """
    failed: set[str] = set()
    interrupted = False

    def run_chain(chain: list[Step]) -> None:
        for step in chain:
            if interrupted or (failed and not keep_going):
                return
            if not run(step):
                failed.add(step.name)

    with ThreadPoolExecutor(lanes) as pool:
        try:
            list(pool.map(run_chain, chains))
        except KeyboardInterrupt:
            interrupted = True
            raise
    return failed


def build(preset: str, *targets: str) -> list[list[str]]:
    """Returns the commands that build a preset, or some of its targets."""
    chosen = ["--target", *targets] if targets else []
    return [
        ["cmake", "--preset", preset],
        ["cmake", "--build", "--preset", preset, "-j", str(JOBS), *chosen],
    ]


def ctest(step: str, preset: str, *options: str) -> list[str]:
    """Returns the command that runs the tests of a built preset and writes a report."""
    report = ["--output-junit", str(LOGS / f"{step}.xml")]
    return ["ctest", "--preset", preset, "-j", str(JOBS), *report, *options]


def pytest(step: str, *options: str, processes: int = JOBS + 1) -> list[str]:
    """Returns the command that runs Python tests, each file in one process, with a report.

    Many tests wait: one process more than processors keeps all processors busy.
    """
    several = ["-n", str(processes), "--dist", "loadfile"] if processes > 1 else []
    return [*PYTHON, "pytest", *several, f"--junit-xml={LOGS / f'{step}.xml'}", *options]


def pytest_of_lerobot(*options: str) -> list[str]:
    """Returns the same command with LeRobot's Python, which also uses the packages of .venv."""
    python = str(ROOT / "build/lerobot/bin/python")
    return [python, *pytest("lerobot", *options, processes=2)[1:]]
