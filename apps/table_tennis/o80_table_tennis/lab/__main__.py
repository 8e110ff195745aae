"""`python -m o80_table_tennis.lab`: plays balls in real time with all nine processes."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

import o80
from o80.base.screen import keep_printing

from ..ending import ends_in_order
from .environment_process import COUNTS, Phase
from .parts import ENVIRONMENT, VIEW, LabSettings, lab_parts
from .processes import PartEndedError, Processes, Watched
from .report import write_report

STARTS_WITHIN = 60.0
"""Timeout of the start of all processes, long enough for a busy machine [s]."""
POLL = 0.5
"""Interval of reading the environment's row [s]."""
CLASSES = {os.SCHED_OTHER: "other", os.SCHED_FIFO: "fifo", os.SCHED_RR: "rr"}


def main(
    count: Annotated[int, typer.Option(min=0, help="Balls to play; 0: until Ctrl-C.")] = 5,
    seed: Annotated[int, typer.Option(min=0, help="Of launches and noise.")] = 1,
    policy: Annotated[str, typer.Option(help="learned, scripted, or a training.")] = "learned",
    output: Annotated[Path, typer.Option(help="Folder that is written.")] = Path("build/lab"),
    prefix: Annotated[str, typer.Option(help="Of the names of all segments.")] = "lab",
    fifo: Annotated[bool, typer.Option(help="Real time for arm and motion capture.")] = True,
    restart: Annotated[bool, typer.Option(help="Start again a process that has ended.")] = False,
) -> None:
    """Plays balls with nine processes, and writes report.json."""
    settings = LabSettings(count, seed, policy, prefix, output, fifo)
    console = Console(highlight=False)
    try:
        report = write_report(settings, play(settings, console, restart=restart))
    except (o80.Error, PartEndedError) as error:
        console.print(str(error), markup=False, style="red")
        sys.exit(1)
    for what, found in report["wanted"].items():
        missed = "" if found["reached"] else ": not reached"
        console.print(f"{what}: {found['measured']} ({found['wanted']}){missed}", markup=False)
    if not all(found["reached"] for found in report["wanted"].values()):
        console.print("`o80 doctor --frequency 500` reports the causes on this computer")
    console.print(f"balls: {report['balls']}\nreport: {settings.folder / 'report.json'}")


def play(settings: LabSettings, console: Console, *, restart: bool) -> dict[str, str]:
    """Plays all balls; returns each process's scheduling class. Raises PartEndedError."""
    settings.recording.unlink(missing_ok=True)
    folder = settings.folder / "processes"
    console.print(f"starts nine processes; what they print is in {folder}")
    with ends_in_order(), Processes(lab_parts(settings).values(), folder) as processes:
        processes.start()
        processes.wait_until_running(STARTS_WITHIN)
        console.print(f"see it at {processes.printed(VIEW)[0]}")
        observer, shown = Watched(settings.segment(ENVIRONMENT)), ""
        while True:
            for name in processes.ended(POLL):
                ended = processes.collected(name)
                if not restart:
                    raise ended
                console.print(f"{ended}\nIt is started again.", markup=False)
                processes.start(name)
            if (environment := observer.now) is None:
                continue
            row = environment.latest().extended
            played, touched, returned, _ = (row[count] for count in COUNTS)
            missing = "".join(f"; {name} is missing" for name in row.missing if row.missing[name])
            line = f"{played} balls, {touched} touched, {returned} returned{missing}"
            if line != shown:
                console.print(shown := line)
            if row.phase == Phase.over:
                return {name: scheduling(each.pid) for name, each in processes.running.items()}


def scheduling(pid: int) -> str:
    """Returns a process's scheduling class, and its priority if any."""
    kind, priority = os.sched_getscheduler(pid), os.sched_getparam(pid).sched_priority
    return f"{CLASSES.get(kind, kind)} {priority or ''}".rstrip()


if __name__ == "__main__":
    keep_printing()
    typer.run(main)
