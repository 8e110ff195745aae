"""Measures the budgets of o80, each beside its limit: a table, and files in build/bench.

Every budget is a row of rows.csv:

| column | what it is |
|---|---|
| name | for --rows |
| program, measured | a program that measures (command_of), and the name of its sample |
| limit, of | a fixed limit, or one of the ratio to a baseline `of` of the same program |
| plain | of USUAL: scales a fixed limit of time by what the plain loop takes here |
| row, budget | the same in words |

A program prints a line a sample: name, unit, value, with tabs between; or name, SKIPPED, reason.
Its first argument is the number of rounds: in each it measures everything once, in turn. A ratio is
that of a round. A budget is missed if the lower quartile of the rounds is above the limit.
"""

import argparse
import csv
import json
import os
import platform
import subprocess
import sys
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from statistics import median, quantiles
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
BUILT = ROOT / "build" / "release"
PAGE = ROOT / "docs" / "results" / "benchmarks.md"
RESULTS = ROOT / "build" / "bench" / "results.json"
LONGEST = 300  # of one program [s]
ROUNDS = 21
ROUNDS_QUICK = 3
SKIPPED = "skipped"
USUAL = {"plain_cpp": 12.0, "plain_python": 34.0}
"""Times of a plain loop on the machine for which fixed limits are meant [ns].

Found in proportion: on another machine, where the copies took 22 ns and the calls 63.5 ns, the
copies of whole histories (baseline of `history`) took 1.9 times as long, and so did `latest`.
"""
HEAD = """\
# Results: benchmarks

This page has one run of [the benchmarks](../../benchmarks/README.md). `make bench ARGS=--page`
writes it; do not edit it. Each figure is a median of rounds, with their quartiles. A ratio (x) is
to what is named beside it, measured in turn with it. A fixed limit is scaled by a plain loop that
was measured beside it. A budget is missed if the lower quartile is above its limit.
"""

Samples = dict[str, tuple[str, list[float]]]
"""Units and values of samples by name; without values the unit is why it was skipped."""
Row = dict[str, str]
"""A line of rows.csv by column."""
Result = dict[str, Any]
"""A row, measured or with the reason why it was not (README.md has its keys)."""


class NotMeasuredError(Exception):
    """Why a program gave no figures."""


def command_of(program: str, rounds: int) -> list[str]:
    """Command that runs the program of a row."""
    python = ROOT / "benchmarks" / f"measure_{program.replace('-', '_')}.py"
    if python.exists():
        return [sys.executable, str(python), str(rounds)]
    compiled = BUILT / "bin" / f"o80-bench-{program}"
    if not compiled.exists():
        raise NotMeasuredError(f"{compiled.name} is not built")
    return [str(compiled), str(rounds)]


def run(program: str, rounds: int) -> Samples:
    """Runs a program to its end. Raises NotMeasuredError."""
    command = command_of(program, rounds)
    try:
        ended = subprocess.run(command, capture_output=True, text=True, timeout=LONGEST)
    except subprocess.TimeoutExpired:
        raise NotMeasuredError(f"'{program}' took longer than {LONGEST} s") from None
    samples: Samples = {}
    for line in ended.stdout.splitlines():
        name, unit, value = line.split("\t")
        if unit == SKIPPED:
            samples[name] = (value, [])
        else:
            samples.setdefault(name, (unit, []))[1].append(float(value))
    if ended.returncode != 0:
        last_words = (ended.stderr.strip() or "it said nothing").splitlines()[-1].strip()
        if not samples:
            raise NotMeasuredError(last_words)
        print(f"{program} failed: {last_words}", file=sys.stderr)
    return samples


def measure(rows: Sequence[Row], rounds: int) -> list[Result]:
    """Runs the programs of these rows; after each its plain loops, which scale its limits."""
    measured: dict[str, Samples | str] = {}
    for program in dict.fromkeys(row["program"] for row in rows):
        print(f"measuring: {program}", file=sys.stderr)
        plain = {row["plain"] for row in rows if row["program"] == program and row["plain"]}
        try:
            samples = run(program, rounds)
            for name in sorted(plain):
                samples |= run(name.replace("_", "-"), ROUNDS)
            measured[program] = samples
        except NotMeasuredError as reason:
            measured[program] = str(reason)
    return [result_of(row, measured[row["program"]]) for row in rows]


def result_of(row: Row, samples: Samples | str) -> Result:
    """Holds the rounds of a program, and of plain loops beside it, against the budget of a row."""
    result: Result = dict.fromkeys(("unit", "measured", "limit", "met", "not_measured"))
    result |= {"row": row["row"], "budget": row["budget"], "quartiles": [], "baseline": {}}
    if isinstance(samples, str):
        return result | {"not_measured": samples}
    for name in filter(None, (row["measured"], row["of"])):
        reason, there = samples.get(name, (f"no '{name}' was given", []))
        if not there:
            return result | {"not_measured": reason}
    unit, values = samples[row["measured"]]
    limit, beside = float(row["limit"]), row["of"] or row["plain"]
    if beside in samples:
        result["baseline"][beside] = base = median(samples[beside][1])
        limit *= 1 if row["of"] else base / USUAL[beside]
    if row["of"]:
        others = samples[row["of"]][1]
        unit, values = "x", [each / other for each, other in zip(values, others, strict=False)]
    once = len(values) == 1
    low, middle, high = values * 3 if once else quantiles(values, n=4, method="inclusive")
    return result | {
        "unit": unit,
        "measured": middle,
        "quartiles": [low, high],
        "limit": limit,
        "met": low <= limit,
        "rounds": len(values),
    }


def output(*command: str) -> str:
    """First line of what a command prints; empty if it fails."""
    try:
        done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        return ""
    return done.stdout.partition("\n")[0]


def conditions() -> str:
    """State of the machine that a run depends on; read before it, because of the load."""
    lines = Path("/proc/cpuinfo").read_text().splitlines()
    models = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    processor = models[0] if models else platform.machine()
    load = ", ".join(f"{each:.1f}" for each in os.getloadavg())
    return (
        f"commit {output('git', 'describe', '--always', '--dirty') or 'unknown'}; "
        f"{datetime.now(UTC):%Y-%m-%d}; {processor}, {len(os.sched_getaffinity(0))} processors; "
        f"Linux {platform.release()}; {output('c++', '--version') or 'unknown compiler'}; "
        f"Python {platform.python_version()}; load before the run {load}."
    )


def line_of(result: Result) -> str:
    """A result as a row of the table."""
    row, budget = (result[key].replace("|", "\\|") for key in ("row", "budget"))
    if result["measured"] is None:
        return f"| {row} | not measured: {result['not_measured']} | | | | |"
    low, high, middle, limit = (
        f"{each:.3g}" if abs(each) < 1000 else f"{each:.0f}"
        for each in (*result["quartiles"], result["measured"], result["limit"])
    )
    met = "yes" if result["met"] else "**no**"
    return f"| {row} | {middle} [{low} {high}] | {limit} | {result['unit']} | {budget} | {met} |"


def page_of(results: Sequence[Result], where: str) -> str:
    """The page of results: one table of one run, and on what it was run."""
    loops = [
        f"{name} {max(found) / usual:.1f}"
        for name, usual in USUAL.items()
        if (found := [each["baseline"][name] for each in results if name in each["baseline"]])
    ]
    slow = f" Times as slow as usual, at worst, were the plain loops: {', '.join(loops)}."
    head = "| what | measured | limit | unit | beside what | met |\n|---|---:|---:|---|---|---|"
    where = f"Run on: {where}{slow if loops else ''}"
    return "\n".join([HEAD, where, "", head, *map(line_of, results)]) + "\n"


def main() -> None:
    with (ROOT / "benchmarks" / "rows.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    names = [row["name"] for row in rows]
    parser = argparse.ArgumentParser(description="Measures the budgets of o80.")
    option = parser.add_argument
    every = "only these: " + ", ".join(names)
    option("--rows", nargs="+", choices=names, default=names, metavar="ROW", help=every)
    option("--quick", action="store_true", help="few repetitions: rough figures")
    option("--page", action="store_true", help=f"write {PAGE.relative_to(ROOT)}, too: of all rows")
    given = parser.parse_args()
    if given.page and (given.rows != names or given.quick):
        parser.error("--page is for a run of all rows: without --rows and --quick")
    rounds = ROUNDS_QUICK if given.quick else ROUNDS
    where = conditions()
    chosen = [row for row in rows if row["name"] in given.rows]
    results = measure(chosen, rounds)
    RESULTS.parent.mkdir(parents=True, exist_ok=True)
    RESULTS.write_text(json.dumps(results, indent=2) + "\n")
    page = page_of(results, where)
    for path in [RESULTS.with_name("benchmarks.md"), *([PAGE] if given.page else [])]:
        path.write_text(page)
    print(page[page.index("| what") :], end="")
    met = [result["met"] for result in results]
    counts = f"{met.count(True)} budgets met, {met.count(False)} missed, {met.count(None)}"
    print(f"{counts} not measured; figures in {RESULTS.relative_to(ROOT)}")


if __name__ == "__main__":
    main()
