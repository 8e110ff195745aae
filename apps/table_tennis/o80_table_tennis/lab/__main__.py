"""`python -m o80_table_tennis.lab`: the laboratory."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

import o80
from o80.base.screen import keep_printing

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
) -> None:
    """Plays balls with nine processes, and writes report.json."""
    settings = LabSettings(count, seed, policy, prefix, output, fifo)
    console = Console()
    try:
        play_in_real_time(settings, console, restart=restart)
    except (o80.Error, PartEndedError) as error:
        console.print(str(error), markup=False, style="red")
        sys.exit(1)


if __name__ == "__main__":
    keep_printing()
    typer.run(main)
