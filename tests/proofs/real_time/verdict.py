"""Reads what the machine said: results for people, and what is wrong with them."""

import json
from collections.abc import Iterator
from dataclasses import dataclass, field

from real_time.machine import Console

PRIORITY = 80
FIFO = "1"  # SCHED_FIFO, as the kernel prints it
LATE = "iterations were late"  # what the loop says of an emulated processor


@dataclass(frozen=True)
class Program:
    """Results of the tests of a program."""

    name: str
    passed: int
    skipped: int
    tests: int


@dataclass
class Findings:
    """The lines of a machine that begin with "rt:", by their first word."""

    lines: dict[str, list[str]] = field(default_factory=dict)

    @classmethod
    def read(cls, console: Console) -> "Findings":
        findings = cls()
        for line in console.text.splitlines():
            if line.startswith("rt: "):
                word, _, rest = line.removeprefix("rt: ").partition(" ")
                findings.lines.setdefault(word, []).append(rest.strip())
        return findings

    def all(self, word: str) -> list[str]:
        return self.lines.get(word, [])

    def one(self, word: str) -> str:
        return (self.all(word) or [""])[-1]

    def account(self, word: str) -> dict[str, int]:
        """Numbers of a line "word key=number key=number"."""
        pairs = (pair.partition("=") for pair in self.one(word).split())
        return {key: int(value) for key, _, value in pairs if value.isdigit()}

    def programs(self) -> list[Program]:
        """Programs that have run all their tests."""
        said = (line.split() for line in self.all("test"))
        return [
            Program(name, int(passed), int(skipped), int(tests))
            for name, passed, skipped, tests in said
        ]

    def durations(self) -> dict[str, float]:
        """Duration of each suite, by the clock of the machine [s]."""
        said = (line.split() for line in self.all("took"))
        return {suite: float(end) - float(begin) for begin, end, suite in said}

    def lateness_of_loop(self) -> dict[int, int]:
        """Iterations by lateness [us]."""
        pairs = (line.split() for line in self.all("lateness"))
        return {int(lateness): int(count) for lateness, count in pairs}

    def lateness_of_cyclictest(self) -> dict[int, int]:
        """Cycles by latency [us]; those beyond its histogram count as the longest."""
        try:
            thread = json.loads(self.one("cyclictest"))["thread"]["0"]
        except (ValueError, KeyError):
            return {}
        histogram = {int(late): int(count) for late, count in thread["histogram"].items()}
        beyond = int(thread["cycles"]) - sum(histogram.values())
        if beyond > 0:
            histogram[int(thread["max"])] = beyond
        return histogram


def percentile(histogram: dict[int, int], share: float) -> int:
    """Lowest lateness below or at which so large a share lies."""
    wanted = share * sum(histogram.values())
    seen = 0
    for lateness in sorted(histogram):
        seen += histogram[lateness]
        if seen >= wanted:
            return lateness
    raise ValueError("nothing was measured")


def jitter(findings: Findings) -> Iterator[str]:
    """Lateness of the loop beside that of cyclictest."""
    both = (findings.lateness_of_loop(), findings.lateness_of_cyclictest())
    if not all(both):
        return
    yield f"{'lateness [us]':>16} {'loop':>9} {'cyclictest':>11}"
    for name, share in (("median", 0.5), ("90 %", 0.9), ("99 %", 0.99), ("99.9 %", 0.999)):
        loop, bare = (percentile(each, share) for each in both)
        yield f"{name:>16} {loop:9} {bare:11}"
    yield f"{'longest':>16} {max(both[0]):9} {max(both[1]):11}"


def report(findings: Findings) -> Iterator[str]:
    """Lines to show."""
    yield f"kernel {findings.one('kernel')}"
    for program in findings.programs():
        yield f"{program.name}: {program.passed} passed, {program.skipped} skipped"
    yield from jitter(findings)
    yield f"frontend: {findings.one('frontend:')}"
    yield (
        f"loop: {findings.one('loop:')} locked={findings.one('locked')} kB "
        f"processors={findings.one('processors')}"
    )


def faults(console: Console, findings: Findings, programs: list[str]) -> Iterator[str]:
    """Faults of the run. Emulated time is slow: how late the loop was is no fault."""
    if not console.powered_off or not findings.all("over"):
        yield "the machine did not power off by itself"
    if "Kernel panic" in console.text:
        yield "the kernel panicked"
    if "PREEMPT_RT" not in findings.one("kernel") or findings.one("realtime") != "1":
        yield "the kernel is not PREEMPT_RT"
    yield from findings.all("wrong")
    if not findings.durations():
        yield "no test ran"
    ran = {each.name: each for each in findings.programs()}
    for name in programs:
        if name not in ran:
            yield f"the tests of {name} did not all run"
        elif ran[name].passed + ran[name].skipped < ran[name].tests:
            yield f"{name}: {ran[name].passed} of {ran[name].tests} tests passed"
    ends = [each.split() for each in findings.all("ended")]
    if ends != [["loop", "0"], ["frontend", "0"]]:
        yield f"the loop and its frontend ended otherwise than in order: {findings.all('ended')}"
    yield from (f"the loop said: {line}" for line in findings.all("said") if LATE not in line)
    yield from faults_of_loop(findings)
    if not findings.lateness_of_loop() or not findings.lateness_of_cyclictest():
        yield "the lateness of the loop or of cyclictest is missing"


def faults_of_loop(findings: Findings) -> Iterator[str]:
    """The options must hold, seen from outside and inside; the loop takes nothing anew."""
    loop = findings.account("loop:")
    # the kernel counts real-time priorities downwards from 99
    if (findings.one("policy"), findings.one("prio")) != (FIFO, str(99 - PRIORITY)):
        yield "the loop was not scheduled at its class and priority, as the kernel sees it"
    if (loop.get("policy"), loop.get("priority")) != (int(FIFO), PRIORITY):
        yield "the loop was not scheduled at its class and priority, as it sees itself"
    if int(findings.one("locked") or 0) == 0:
        yield "the loop's memory was not locked"
    if findings.one("processors") != "1":
        yield "the loop was not kept on its processor"
    for what in ("allocations", "minor_faults", "major_faults"):
        if loop.get(what) != 0:
            yield f"{what.replace('_', ' ')} in the loop: {loop.get(what, 'unknown')}"
    if findings.account("frontend:").get("batches", 0) == 0:
        yield "the frontend completed no batch"
