"""The page of results, docs/results/benchmarks.md: one table of one run, and on what it was run."""

import os
import platform
import subprocess
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path

from programs import ROOT
from results import Result, shown
from rows import USUAL

PAGE = ROOT / "docs" / "results" / "benchmarks.md"
HEAD = """\
# Results: benchmarks

This page has one run of [the benchmarks](../../benchmarks/README.md). `make bench ARGS=--page`
writes it; do not edit it. Each figure is a median. A limit is a factor of a baseline that the same
run measured, or a fixed figure, scaled by a plain loop that was measured beside it.
"""
MET = {True: "yes", False: "**no**", None: ""}


def output(*command: str) -> str:
    """First line of what a command prints; empty if it fails."""
    try:
        done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        return ""
    return done.stdout.partition("\n")[0]


def conditions() -> list[str]:
    """State of the machine that a run depends on; read before it, because of the load."""
    models = [
        line.partition(":")[2].strip()
        for line in Path("/proc/cpuinfo").read_text().splitlines()
        if line.startswith("model name")
    ]
    processor = models[0] if models else platform.machine()
    load = ", ".join(f"{each:.1f}" for each in os.getloadavg())
    return [
        f"commit {output('git', 'describe', '--always', '--dirty') or 'unknown'}",
        f"{datetime.now(UTC):%Y-%m-%d}",
        f"{processor}, {len(os.sched_getaffinity(0))} processors",
        f"Linux {platform.release()}",
        output("c++", "--version") or "unknown compiler",
        f"Python {platform.python_version()}",
        f"load before the run {load}",
    ]


def cell(text: str) -> str:
    return text.replace("|", "\\|")


def line_of(result: Result) -> str:
    """One row of the table."""
    if result.measured is None:
        return f"| {cell(result.row)} | not measured: {cell(result.not_measured or '')} | | | | |"
    numbers = f"{shown(result.measured)} | {shown(result.limit)} | {result.unit}"
    return f"| {cell(result.row)} | {numbers} | {cell(result.budget)} | {MET[result.met]} |"


def text_of(results: Sequence[Result], where: Sequence[str]) -> str:
    """The whole page."""
    loops = [
        f"{name} {max(found) / usual:.1f}"
        for name, usual in USUAL.items()
        if (found := [each.baseline[name] for each in results if name in each.baseline])
    ]
    slow = f" Times as slow as usual, at worst, were the plain loops: {', '.join(loops)}."
    lines = [HEAD, f"Run on: {'; '.join(where)}.{slow if loops else ''}", ""]
    lines += [
        "| what | measured | limit | unit | beside what | met |",
        "|---|---:|---:|---|---|---|",
    ]
    return "\n".join([*lines, *map(line_of, results)]) + "\n"
