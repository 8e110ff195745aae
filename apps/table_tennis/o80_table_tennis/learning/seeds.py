"""Several trainings beside each other: `python -m o80_table_tennis.learning.seeds FOLDER...`.

Each folder is one that `python -m o80_table_tennis.train` has written. Prints what came of each,
their median and their worst, and draws all curves in one picture.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich.console import Console
from rich.table import Table

from . import curve
from .curve import CURVE
from .curve_plot import plot_curves
from .episodes import Shares
from .verdict import REPORT

LEARNED = ("learned", "blind")
"""Names of evaluations of what was trained; the others are baselines without any."""


def main(
    folders: Annotated[list[Path], typer.Argument(help="One for each training.")],
    picture: Annotated[Path, typer.Option(help="File that is drawn.")] = Path("build/learn.png"),
) -> None:
    """Compares trainings with different seeds."""
    try:
        reports = {folder: json.loads((folder / REPORT).read_text()) for folder in folders}
        curves = {_label(folder, reports[folder]): curve.read(folder / CURVE) for folder in folders}
    except (OSError, ValueError) as error:
        print(f"o80: {error}: give folders of finished trainings", file=sys.stderr)
        raise typer.Exit(1) from error
    _print(reports, Console())
    first = next(iter(reports.values()))
    plot_curves(
        picture,
        curves,
        baselines={
            name: Shares(each["touched"], each["returned"], each["reward"])
            for name, each in first["evaluations"].items()
            if name not in LEARNED and "recorded" not in name
        },
        title=f"learning to return {first['conditions']['balls']} shots",
    )
    print(f"curves: {picture}")


def verdict(report: dict[str, Any]) -> dict[str, Any]:
    """The evaluation of what was trained."""
    evaluations: dict[str, dict[str, Any]] = report["evaluations"]
    return next(evaluations[name] for name in LEARNED if name in evaluations)


def _label(folder: Path, report: dict[str, Any]) -> str:
    blind = "learned" not in report["evaluations"]
    return f"{'blind, ' if blind else ''}seed {report['seed']} ({folder.name})"


def _print(reports: dict[Path, dict[str, Any]], console: Console) -> None:
    table = Table()
    for name in ("training", "decisions", "processor time", "touched", "returned"):
        table.add_column(name, justify="left" if name == "training" else "right")
    for folder, report in reports.items():
        seen = verdict(report)
        table.add_row(
            _label(folder, report),
            str(report["decisions"]),
            f"{report['minutes']:.1f} min",
            f"{100 * seen['touched']:.1f} %",
            f"{100 * seen['returned']:.1f} %",
        )
    console.print(table)
    returned = [
        100 * verdict(report)["returned"]
        for report in reports.values()
        if "learned" in report["evaluations"]
    ]
    if returned:
        console.print(
            f"returned: median {np.median(returned):.1f} %, worst {min(returned):.1f} %, "
            f"best {max(returned):.1f} %",
            highlight=False,
        )


if __name__ == "__main__":
    typer.run(main)
