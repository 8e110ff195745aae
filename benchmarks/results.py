"""Samples and budgets become results: a table for people, JSON for programs."""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path

from rich.console import Console
from rich.table import Table

from programs import Samples
from rows import USUAL, Row


@dataclass(frozen=True, kw_only=True)
class Result:
    """One row, measured or with the reason why it was not."""

    row: str
    unit: str | None = None
    measured: float | None = None  # median over the rounds
    limit: float | None = None  # that it is to keep, in the same unit
    budget: str
    met: bool | None = None
    best: float | None = None
    rounds: int = 0
    baseline: dict[str, float] = field(default_factory=dict)  # medians of the same run
    not_measured: str | None = None


def result_of(row: Row, samples: dict[str, Samples]) -> Result:
    """Holds the medians of a program, and of plain loops beside it, against the budget of a row."""
    measured = samples.get(row.measured)
    if measured is None:
        return Result(row=row.row, budget=row.budget, not_measured=f"no '{row.measured}' was given")
    baseline = {}
    if isinstance(row.limit, tuple):
        factor, name = row.limit
        if name not in samples:
            return Result(row=row.row, budget=row.budget, not_measured=f"no '{name}' was given")
        baseline[name] = samples[name].median
        limit = factor * baseline[name]
    else:
        limit = row.limit
        if row.plain is not None and row.plain in samples:
            baseline[row.plain] = samples[row.plain].median
            limit *= baseline[row.plain] / USUAL[row.plain]
    value = measured.median
    return Result(
        row=row.row,
        unit=measured.unit,
        measured=value,
        limit=limit,
        budget=row.budget,
        met=value >= limit if row.at_least else value <= limit,
        best=max(measured.values) if row.at_least else min(measured.values),
        rounds=len(measured.values),
        baseline=baseline,
    )


def shown(value: float | None) -> str:
    return "" if value is None else f"{value:.3g}" if abs(value) < 1000 else f"{value:.0f}"


def print_table(results: Sequence[Result], console: Console) -> None:
    table = Table(title="Budgets (medians; limits from baselines of the same run)")
    for title in ("what", "budget"):
        table.add_column(title)
    for title in ("measured", "best", "limit"):
        table.add_column(title, justify="right")
    for title in ("unit", "met"):
        table.add_column(title)
    for result in results:
        met = {True: "[green]yes", False: "[red]NO", None: "-"}[result.met]
        numbers = [shown(value) for value in (result.measured, result.best, result.limit)]
        table.add_row(result.row, result.budget, *numbers, result.unit or "", met)
    console.print(table)
    for reason in dict.fromkeys(result.not_measured for result in results if result.not_measured):
        rows = "; ".join(result.row for result in results if result.not_measured == reason)
        console.print(f"not measured ({reason}): {rows}", markup=False)


def write(results: Sequence[Result], path: Path) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps([asdict(result) for result in results], indent=2) + "\n")
