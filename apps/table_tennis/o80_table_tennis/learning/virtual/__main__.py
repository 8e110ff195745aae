"""Compares learning with and without virtual balls: `python -m o80_table_tennis.learning.virtual`.

Writes a curve for each way and seed, their picture and a table; curves that are there are kept, so
that several commands can share the work. Needs the extra `learn`.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

import o80
from o80.base.extras import needed

from ...ending import unwind_on_sigterm

OUTPUT = Path("build/virtual_balls")
SEEDS = [1, 2, 3]


def main(
    way: Annotated[
        list[str] | None, typer.Option(help="none, more_steps, all or selected; may be repeated.")
    ] = None,
    seed: Annotated[list[int] | None, typer.Option(min=0, help="May be repeated.")] = None,
    motions: Annotated[int | None, typer.Option(min=1, help="Of the arm, in a training.")] = None,
    output: Annotated[Path, typer.Option(help="Folder that is written.")] = OUTPUT,
    plot_only: Annotated[bool, typer.Option(help="Draw the curves that are there.")] = False,
) -> None:
    """Learns to return balls in each way, and draws the curves."""
    unwind_on_sigterm()
    console = Console()
    try:
        for module in ("torch", "stable_baselines3"):
            needed(module, "learn", "learning", package="o80-table-tennis")
        from .comparison import draw, run
        from .settings import WAYS

        output.mkdir(parents=True, exist_ok=True)
        if not plot_only:
            run(way or list(WAYS), seed or SEEDS, output, console, motions=motions)
        draw(output, console)
    except (ValueError, o80.Error) as error:
        print(f"o80: {error}", file=sys.stderr)
        raise typer.Exit(1) from error


if __name__ == "__main__":
    typer.run(main)
