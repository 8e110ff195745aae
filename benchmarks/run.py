"""Measures the budgets of o80, each beside its limit: a table, and files in build/bench."""

import argparse
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from page import PAGE, conditions, text_of
from programs import ROOT, NotMeasuredError, Samples, run
from results import Result, print_table, result_of, write
from rows import ROWS, Row

ROUNDS = 21
ROUNDS_QUICK = 3


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__)
    names = [row.name for row in ROWS]
    parser.add_argument("--rows", nargs="+", choices=names, default=names, metavar="ROW",
                        help="only these: " + ", ".join(names))  # fmt: skip
    parser.add_argument("--quick", action="store_true", help="few repetitions: rough figures")
    parser.add_argument("--rounds", type=int, help=f"repetitions of each (default: {ROUNDS})")
    parser.add_argument("--built", type=Path, default=ROOT / "build" / "release", metavar="FOLDER",
                        help="where the programs were built (default: build/release)")  # fmt: skip
    parser.add_argument("--page", action="store_true",
                        help="write docs/results/benchmarks.md, too: of all rows")  # fmt: skip
    requested = parser.parse_args()
    if requested.page and (requested.rows != names or requested.quick):
        parser.error("--page is for a run of all rows: without --rows and --quick")
    return requested


def plain(rows: Sequence[Row], program: str, built: Path) -> dict[str, Samples]:
    """The plain loops by which limits of the rows of a program are scaled, measured after it."""
    names = sorted({row.plain for row in rows if row.program == program and row.plain is not None})
    found: dict[str, Samples] = {}
    for name in names:
        found |= run(name.replace("_", "-"), ROUNDS, built)
    return found


def measure(rows: Sequence[Row], rounds: int, built: Path, console: Console) -> list[Result]:
    measured: dict[str, dict[str, Samples] | str] = {}
    for program in dict.fromkeys(row.program for row in rows):
        with console.status(f"measuring: {program}"):
            try:
                measured[program] = run(program, rounds, built) | plain(rows, program, built)
            except NotMeasuredError as reason:
                measured[program] = str(reason)
    results = []
    for row in rows:
        samples = measured[row.program]
        if isinstance(samples, str):
            results.append(Result(row=row.row, budget=row.budget, not_measured=samples))
        else:
            results.append(result_of(row, samples))
    return results


def main() -> int:
    requested = arguments()
    rounds = requested.rounds or (ROUNDS_QUICK if requested.quick else ROUNDS)
    console = Console()
    if not console.is_terminal:
        console = Console(width=150)
    chosen = [row for row in ROWS if row.name in requested.rows]
    where = conditions()
    results = measure(chosen, rounds, requested.built.resolve(), console)
    print_table(results, console)
    path = ROOT / "build" / "bench" / "results.json"
    write(results, path)
    pages = [path.with_name("benchmarks.md"), *([PAGE] if requested.page else [])]
    for page in pages:
        page.write_text(text_of(results, where))
    missed = [result.row for result in results if result.met is False]
    unknown = sum(result.met is None for result in results)
    console.print(
        f"{len(results) - len(missed) - unknown} budgets met, {len(missed)} missed, "
        f"{unknown} not measured; figures in {path.relative_to(ROOT)}, "
        f"table in {pages[-1].relative_to(ROOT)}"
    )
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
