"""`python -m o80_table_tennis.lab`: the laboratory, in real time or in lock-step."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import Progress

import o80

from .comparison import WANTED, compare, write
from .parts import LabSettings
from .processes import PartEndedError
from .real_time import play_in_real_time


def main(
    count: Annotated[int, typer.Option(min=0, help="Balls to play; 0: until Ctrl-C.")] = 5,
    seed: Annotated[int, typer.Option(min=0, help="Of launches and noise.")] = 1,
    policy: Annotated[str, typer.Option(help="learned or scripted.")] = "learned",
    output: Annotated[Path, typer.Option(help="Folder that is written.")] = Path("build/lab"),
    prefix: Annotated[str, typer.Option(help="Of the names of all segments.")] = "lab",
    fifo: Annotated[bool, typer.Option(help="Real time for arm and motion capture.")] = True,
    restart: Annotated[bool, typer.Option(help="Start again a process that has ended.")] = False,
    bursting: Annotated[
        bool,
        typer.Option(
            "--bursting",
            help="In lock-step, in simulated time: tracked against true balls.",
        ),
    ] = False,
) -> None:
    """Plays balls with nine processes, and writes report.json."""
    settings = LabSettings(count, seed, policy, prefix, output, fifo)
    console = Console()
    try:
        if bursting:
            play_in_lock_step(settings, console)
            return
        play_in_real_time(settings, console, restart=restart)
    except (o80.Error, PartEndedError) as error:
        console.print(str(error), markup=False, style="red")
        sys.exit(1)


def play_in_lock_step(settings: LabSettings, console: Console) -> None:
    """Plays the same balls as the tracker sees them and as they are, and adds to report.json."""
    if settings.balls < 1:
        raise o80.InvalidArgument("in lock-step, balls are counted: give --count 1 or more")
    with Progress(console=console, transient=True) as bars:
        bar = bars.add_task("balls", total=2 * settings.balls)
        comparison = compare(settings, after_each=lambda _: bars.advance(bar))
    found = comparison.as_json()
    console.print(
        f"{found['balls']} balls: {found['returned_tracked']} returned as the tracker sees them, "
        f"{found['returned_true']} as they are: {found['share']:.2f} of these (wanted: {WANTED})",
        highlight=False,
    )
    console.print(f"report: {write(comparison, settings.folder)}")


if __name__ == "__main__":
    typer.run(main)
