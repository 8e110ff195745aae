"""The real-time loop on a machine under stress, beside cyclictest: tables and histograms.

For each frequency, a robot's process and cyclictest run at once, on one processor, in one class
and at one priority, while stress-ng keeps all processors busy and many processes wait for every
row. Writes build/bench/stress.json and a picture for each frequency.
"""

import argparse
import ctypes
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

import o80

ROOT = Path(__file__).resolve().parent.parent
OUTPUT = ROOT / "build" / "bench"
PRIORITY = 80
FREQUENCIES = (1000, 500)
SECONDS = 60.0
SECONDS_QUICK = 5.0
READERS = 64
PERCENTILES = (50.0, 99.0, 99.9, 100.0)
PATIENCE = 30.0  # for anything to start or end [s]
PR_SET_PDEATHSIG = 1

Latencies = NDArray[np.floating[Any]]


class NotMeasuredError(Exception):
    """What the machine lacks or refuses."""


@dataclass(frozen=True)
class Run:
    """What one frequency gave; latencies in us."""

    frequency: int
    iterations: int
    overruns: int
    skipped: int
    loop: list[float]  # at PERCENTILES
    cyclictest: list[float]

    @property
    def ratios(self) -> list[float]:
        return [
            ours / theirs if theirs > 0 else float("nan")
            for ours, theirs in zip(self.loop, self.cyclictest, strict=True)
        ]


def arguments(words: Sequence[str] | None = None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, help=f"of each frequency (default: {SECONDS:g})")
    parser.add_argument("--quick", action="store_true", help=f"{SECONDS_QUICK:g} seconds each")
    parser.add_argument("--readers", type=int, default=READERS, metavar="N",
                        help=f"processes that wait for every row (default: {READERS})")  # fmt: skip
    parser.add_argument("--calm", action="store_true", help="without stress-ng, for comparison")
    parser.add_argument("--built", type=Path, default=ROOT / "build" / "release", metavar="FOLDER",
                        help="where the programs were built (default: build/release)")  # fmt: skip
    return parser.parse_args(words)


# ---------------------------------------------------------------------------- what runs


def die_with_parent() -> None:
    """In a child that is about to become a program: nothing outlives this process."""
    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)


@contextmanager
def running(words: Sequence[str | Path], **options: Any) -> Iterator["subprocess.Popen[str]"]:
    """A program until the end of the block, asked to stop, then killed."""
    try:
        program = subprocess.Popen(words, text=True, preexec_fn=die_with_parent, **options)
    except FileNotFoundError:
        raise NotMeasuredError(f"{words[0]} is not there: build or install it first") from None
    try:
        yield program
    finally:
        program.terminate()
        try:
            program.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            program.kill()
            program.wait()


def loop(
    built: Path, segment: str, frequency: int, seconds: float, processor: int
) -> list[str | Path]:
    rows = int(frequency * (seconds + 2 * PATIENCE))
    return [built / "bin" / "o80-run", "two_joints", "--segment", segment, "--frequency",
            str(frequency), "--history", str(rows), "--policy", "fifo", "--priority",
            str(PRIORITY), "--cpus", str(processor), "--lock-memory", "--until-eof"]  # fmt: skip


def stress(seconds: float) -> list[str]:
    """Computing, memory, pipes, sockets and switches; no disk."""
    processors = str(len(os.sched_getaffinity(0)))
    longest = str(int(seconds + 2 * PATIENCE))  # whatever becomes of this process
    return ["stress-ng", "--quiet", "--cpu", processors, "--vm", "1", "--vm-bytes", "64M",
            "--pipe", "1", "--sock", "1", "--switch", "1", "--timeout", longest]  # fmt: skip


def cyclictest(frequency: int, seconds: float, processor: int, phase: int) -> list[str]:
    """Its wake-ups lie so long [us] after whole periods."""
    return ["cyclictest", "-m", "-N", "-v", "-t", "1", "-a", str(processor), "-p", str(PRIORITY),
            "-i", str(1_000_000 // frequency), "-d", "0",
            f"--secaligned={phase}", "-l", str(int(frequency * seconds))]  # fmt: skip


def latencies_of(output: str) -> Latencies:
    """Of cyclictest's lines "thread: count: latency [ns]", in us."""
    fields = (line.split(":") for line in output.splitlines())
    values = [int(line[2]) for line in fields if len(line) == 3 and line[2].strip().isdigit()]
    return np.array(values) * 1e-3


def measured_beside(command: list[str], seconds: float) -> Latencies:
    with (
        tempfile.TemporaryFile("w+") as output,
        running(command, stdout=output, stderr=subprocess.PIPE) as program,
    ):
        program.wait(seconds + PATIENCE)
        if program.returncode != 0:
            why = program.stderr.read() if program.stderr is not None else ""
            raise NotMeasuredError(f"cyclictest failed: {why.strip()}")
        output.seek(0)
        return latencies_of(output.read())


@contextmanager
def robot(built: Path, frequency: int, seconds: float, processor: int) -> Iterator[o80.Frontend]:
    segment = f"stress-{frequency}-{os.getpid()}"
    words = loop(built, segment, frequency, seconds, processor)
    with tempfile.TemporaryFile("w+") as refused:
        pipes: dict[str, Any] = {"stdin": subprocess.PIPE, "stdout": subprocess.DEVNULL}
        with running(words, stderr=refused, **pipes):
            frontend = o80.Frontend(segment, timeout=PATIENCE)
            try:
                frontend.wait_for(1, timeout=PATIENCE)
                refused.seek(0)
                if lines := refused.read().strip():
                    raise NotMeasuredError(lines)
                yield frontend
            finally:
                frontend.close()


# ---------------------------------------------------------------------------- what came of it


def percentiles(latencies: Latencies) -> list[float]:
    return [float(value) for value in np.percentile(latencies, PERCENTILES)]


def measure(
    asked: argparse.Namespace, frequency: int, seconds: float
) -> tuple[Run, Latencies, Latencies]:
    """Also gives the latencies of the loop and of cyclictest."""
    processor = max(os.sched_getaffinity(0))
    with ExitStack() as stack:
        built = asked.built.resolve()
        arm = stack.enter_context(robot(built, frequency, seconds, processor))
        reader = [built / "bin" / "o80-bench-reader", arm.segment]
        for _ in range(asked.readers):
            stack.enter_context(running(reader, stdout=subprocess.DEVNULL))
        if not asked.calm:
            stack.enter_context(running(stress(seconds), stderr=subprocess.DEVNULL))
        time.sleep(min(1.0, seconds))  # the load is to be under way
        first = arm.latest()
        # half a period apart: neither finds the other at work
        due = int(first.time - first.lateness)
        period = 1_000_000_000 // frequency
        phase = (due + period // 2) % period // 1000
        theirs = measured_beside(cyclictest(frequency, seconds, processor, phase), seconds)
        last = arm.latest()
        rows = arm.history(since=first.iteration + 1, until=last.iteration)
        ours = rows.lateness * 1e-3
    run = Run(
        frequency=frequency,
        iterations=len(ours),
        overruns=int(last.overruns - first.overruns),
        skipped=int(last.skipped - first.skipped),
        loop=percentiles(ours),
        cyclictest=percentiles(theirs),
    )
    return run, ours, theirs


def draw(run: Run, ours: Latencies, theirs: Latencies, path: Path, load: str) -> None:
    """Both histograms in one picture, on logarithmic axes."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    everything = np.maximum(np.concatenate([ours, theirs]), 0.1)
    bins = np.geomspace(everything.min() * 0.9, everything.max() * 1.1, 80)
    figure, axes = pyplot.subplots(figsize=(9, 5))
    for values, name, colour in ((theirs, "cyclictest", "tab:gray"), (ours, "o80", "tab:blue")):
        label = f"{name}: 99 % below {np.percentile(values, 99):.0f} us, max {values.max():.0f} us"
        axes.hist(np.maximum(values, bins[0]), bins=list(bins), histtype="step", linewidth=1.5,
                  color=colour, label=label)  # fmt: skip
        axes.axvline(float(np.percentile(values, 99)), color=colour, linestyle=":", linewidth=1)
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlabel("how late an iteration began [us]")
    axes.set_ylabel("iterations")
    axes.set_title(
        f"{run.frequency} Hz, {run.iterations} iterations, overruns: {run.overruns}; {load}"
    )
    axes.legend()
    axes.grid(visible=True, which="major", alpha=0.3)
    figure.tight_layout()
    figure.savefig(path, dpi=120)
    pyplot.close(figure)


def table_of(runs: Sequence[Run], load: str) -> Table:
    table = Table(title=rf"how late an iteration begins \[us], {load}")
    table.add_column("")
    for percentile in PERCENTILES:
        table.add_column("max" if percentile == 100.0 else f"{percentile:g} %", justify="right")
    table.add_column("overruns", justify="right")
    for run in runs:
        overruns = f"{run.overruns} of {run.iterations}"
        table.add_row(f"o80, {run.frequency} Hz", *(f"{v:.1f}" for v in run.loop), overruns)
        table.add_row("cyclictest beside it", *(f"{v:.1f}" for v in run.cyclictest), "")
        table.add_row("ratio", *(f"{v:.2f}" for v in run.ratios), "", end_section=True)
    return table


def write(runs: Sequence[Run], load: str, path: Path) -> None:
    """Percentiles and ratios in the order of `percentiles`."""
    results = [{**asdict(run), "ratios": run.ratios} for run in runs]
    everything = {"load": load, "percentiles": PERCENTILES, "runs": results}
    path.write_text(json.dumps(everything, indent=2))


def main(words: Sequence[str] | None = None) -> int:
    asked = arguments(words)
    seconds = asked.seconds or (SECONDS_QUICK if asked.quick else SECONDS)
    load = f"{asked.readers} readers" + ("" if asked.calm else " and stress-ng")
    # told to end, it takes along what it started
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    OUTPUT.mkdir(parents=True, exist_ok=True)
    console = Console()
    if not console.is_terminal:
        console = Console(width=100)
    runs = []
    try:
        for frequency in FREQUENCIES:
            with console.status(f"{frequency} Hz for {seconds:g} s"):
                run, ours, theirs = measure(asked, frequency, seconds)
            draw(run, ours, theirs, OUTPUT / f"stress-{frequency}Hz.png", load)
            runs.append(run)
    except NotMeasuredError as reason:
        console.print(f"not measured: {reason}", style="red", soft_wrap=True)
        return 1
    write(runs, load, OUTPUT / "stress.json")
    console.print(table_of(runs, load))
    console.print(f"pictures and figures in {OUTPUT.relative_to(ROOT)}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
