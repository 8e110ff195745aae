"""Steps of `make test` and `make check`: commands, their logs, and what to show of them."""

import os
import re
import subprocess
import sys
import time
from collections import deque
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from outcomes import Outcomes, of_ctest, of_pytest
from sources import ROOT

BEGIN = time.monotonic()
JOBS = len(os.sched_getaffinity(0))
LOGS = ROOT / "build" / "test"
PASSED = LOGS / "passed.json"  # what `make test` passed, on which files
PYTHON = [sys.executable, "-m"]
CTEST_CLOSING = r"^\d+% tests passed|^Total Test time"
PYTEST_CLOSING = r"^left to make check|^left out|^=+ .*\b(passed|skipped|deselected)\b.* =+$"


@dataclass(frozen=True)
class Step:
    """Commands that are run one after the other until one fails."""

    name: str
    commands: list[list[str]]
    closing: str = ""  # lines of its log that match this are shown when it passed; empty: the last
    outcomes: Callable[[], Outcomes] = Outcomes

    @property
    def log(self) -> Path:
        return LOGS / f"{self.name}.log"


def use_tools() -> None:
    """Makes the tools of the environment the first that are found, and the folder of logs."""
    tools = Path(sys.executable).parent
    os.environ["PATH"] = f"{tools}{os.pathsep}{os.environ['PATH']}"
    os.environ.setdefault("CCACHE_DIR", str(ROOT / "build" / "ccache"))
    # presets share what they compile alike
    os.environ.setdefault("CCACHE_NOHASHDIR", "1")
    os.environ.setdefault("CCACHE_BASEDIR", str(ROOT))
    os.environ.setdefault("CCACHE_ABSSTDERR", "1")  # paths in errors stay whole
    LOGS.mkdir(parents=True, exist_ok=True)


def processor_time() -> float:
    """Processor time of all programs that were run so far and have ended [s]."""
    times = os.times()
    return times.children_user + times.children_system


def last_lines(step: Step, count: int) -> list[str]:
    with step.log.open(errors="replace") as text:
        return list(deque(text, count))


def closing_lines(step: Step) -> list[str]:
    if not step.closing:
        return last_lines(step, 1)
    with step.log.open(errors="replace") as text:
        return [line for line in text if re.search(step.closing, line)]


def run(step: Step) -> bool:
    """Runs a step; shows its closing lines, or most of its log when it fails."""
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
    shown = closing_lines(step) if returned == 0 else last_lines(step, 400)
    took = f"{now - begin:.0f} s ({used:.0f} s of processor time)"
    text = f"{''.join(shown)}== {now - BEGIN:3.0f} s: {step.name}: {verdict} in {took}"
    print(text, flush=True)
    return returned == 0


def run_beside(chains: Iterable[list[Step]], lanes: int, *, keep_going: bool = False) -> set[str]:
    """Runs chains of steps, as many of them at the same time as there are lanes; what failed.

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
    """Commands that build a preset, or some targets of it."""
    chosen = ["--target", *targets] if targets else []
    return [
        ["cmake", "--preset", preset],
        ["cmake", "--build", "--preset", preset, "-j", str(JOBS), *chosen],
    ]


def ctest(preset: str, *options: str, report: str | None = None) -> Step:
    """Runs the tests of a preset that is built. The report is named after the preset by default."""
    name = report or preset
    file = LOGS / f"{name}.xml"
    # a thread sanitizer of this age cannot stand the widest address randomisation
    random_bits = int(Path("/proc/sys/vm/mmap_rnd_bits").read_text())
    fixed_addresses = ["setarch", "-R"] if preset == "tsan" and random_bits > 28 else []
    command = [
        *fixed_addresses,
        *("ctest", "--preset", preset, "-j", str(JOBS), "--output-junit", str(file)),
        *options,
    ]
    return Step(name, [command], CTEST_CLOSING, lambda: of_ctest(file))


def cpp(preset: str, *options: str, report: str | None = None) -> Step:
    """Builds a preset and runs its tests."""
    tests = ctest(preset, *options, report=report)
    return Step(tests.name, [*build(preset), *tests.commands], tests.closing, tests.outcomes)


def pytest(*options: str, report: str = "pytest", processes: int = JOBS + 1) -> Step:
    """Runs tests in Python, each file in one process. Many tests wait: one process more than there
    are processors keeps these busy."""
    file = LOGS / f"{report}.xml"
    several = ["-n", str(processes), "--dist", "loadfile"] if processes > 1 else []
    command = [*PYTHON, "pytest", *several, f"--junit-xml={file}", *options]
    return Step(report, [command], PYTEST_CLOSING, lambda: of_pytest(file))
