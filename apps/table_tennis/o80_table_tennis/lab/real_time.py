"""Plays balls in real time with all nine processes, and says what becomes of each.

A process that ends by itself ends the lab, which names it and shows its last lines; with `restart`
it is started again, and the lab goes on.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Self

from rich.console import Console
from rich.live import Live
from rich.table import Table

import o80
from o80.base.finite import json_text
from o80.base.lifecycle import Closeable

from ..ending import ends_in_order
from .environment_row import Phase
from .loops import Loop, loop_of
from .parts import COUNTERPARTS, ENVIRONMENT, LabSettings, lab_parts
from .processes import Part, Processes, processor_seconds
from .report import write_report
from .watched import Watched

STARTS_WITHIN = 60.0
"""All processes, on a busy machine [s]."""
SHOWN_EVERY = 0.5
"""The table [s]."""


class Events(Closeable):
    """Log of the processes: a file of JSON lines in a folder, which is there."""

    def __init__(self, folder: Path) -> None:
        self._file = (folder / "events.jsonl").open("w")

    def close(self) -> None:
        """Closes the file."""
        self._file.close()

    def add(self, part: str, what: str) -> None:
        """Now."""
        line = {"time": time.monotonic_ns(), "part": part, "what": what}
        self._file.write(json_text(line) + "\n")
        self._file.flush()


class Lab(Closeable):
    """The running processes, and how their loops keep up. A context manager."""

    def __init__(self, settings: LabSettings, *, restart: bool = False) -> None:
        self.settings, self._restart = settings, restart
        settings.recording.unlink(missing_ok=True)
        self.processes = Processes(lab_parts(settings).values(), settings.folder / "processes")
        self._observers = {
            part.name: Watched(part.segment)
            for part in self.processes.parts.values()
            if part.segment is not None and part.name != COUNTERPARTS
        }
        self.events = Events(settings.folder)
        self._row: Any = None
        self.ended: list[str] = []
        """Processes that have ended by themselves and were started again."""

    def __enter__(self) -> Self:
        try:
            self.processes.start()
            self.processes.wait_until_running(STARTS_WITHIN)
        except BaseException:
            self.close()
            raise
        for name in self.processes.running:
            self.events.add(name, "runs")
        return self

    def close(self) -> None:
        """Ends all processes; may be called twice."""
        try:
            for observer in self._observers.values():
                observer.close()
            self.processes.close()
        finally:
            self.events.close()

    def look(self, timeout: float) -> bool:
        """Waits so long for a process to end; False: the environment has played all balls.

        Raises PartEndedError for a process that ends, unless they are started again.
        """
        for name in self.processes.ended(timeout):
            ended = self.processes.collected(name)
            self.events.add(name, str(ended))
            if not self._restart:
                raise ended
            self.ended.append(name)
            self.processes.start((name,))
            self.events.add(name, "started again")
        row = self.row_of_environment()
        if row is None or row.phase != Phase.over:
            return True
        self.events.add(ENVIRONMENT, "has played all balls")
        return False

    def row_of_environment(self) -> Any:
        """Its newest row, or the last one that was seen; None: it was never there."""
        frontend = self._observers[ENVIRONMENT].frontend()
        if frontend is not None:
            self._row = frontend.latest().extended
        return self._row

    def loops(self) -> dict[str, Loop]:
        """How the loop of each part that is there keeps its rate."""
        return {
            name: loop
            for name, observer in self._observers.items()
            if (loop := loop_of(observer, self.processes.parts[name])) is not None
        }


def play_in_real_time(
    settings: LabSettings, console: Console, *, restart: bool = False
) -> dict[str, Any]:
    """Plays, writes report.json, returns what it holds. Raises PartEndedError, o80.TimeoutError."""
    with ends_in_order():
        console.print(f"starts nine processes; what they print is in {settings.folder}/processes")
        with Lab(settings, restart=restart) as lab:
            view = lab.processes.printed("view").split("\n")[0]
            if view:
                console.print(f"see it at {view}")
            begin = last = _usage(lab.processes)
            started = time.monotonic()
            at_begin = lab.loops()
            loops: dict[str, Loop] = {}
            with Live(console=console, auto_refresh=False) as live:
                playing = True
                while playing:
                    playing = lab.look(SHOWN_EVERY)
                    now = lab.loops().items()
                    loops |= {name: loop.since(at_begin.get(name)) for name, loop in now}
                    last = {**last, **_usage(lab.processes)}
                    live.update(table_of(lab, loops), refresh=True)
            seconds = time.monotonic() - started
            usage = {
                name: 100.0 * (used - begin.get(name, 0.0)) / seconds for name, used in last.items()
            }
        report = write_report(settings, loops, usage, seconds)
        console.print()
        for what, found in report["wanted"].items():
            wanted = found.get("wanted", f"at most {found.get('most')}")
            missed = "" if found["reached"] else ": not reached"
            console.print(f"{what}: {found['measured']} ({wanted}){missed}", highlight=False)
        if not all(found["reached"] for found in report["wanted"].values()):
            console.print("`o80 doctor --frequency 500` says what is in the way on this computer")
        console.print(f"balls: {report['balls']}", highlight=False)
        console.print(f"report: {settings.folder / 'report.json'}")
        return report


def _usage(processes: Processes) -> Mapping[str, float]:
    """Processor time of each [s], this process included."""
    own = processor_seconds("self")
    return {**processes.processor_seconds(), "supervisor": own or 0.0}


def table_of(lab: Lab, loops: Mapping[str, Loop]) -> Table:
    """Table of what each process does now."""
    row = lab.row_of_environment()
    table = Table(title=title_of(row))
    for column in ("process", "rate [1/s]", "asked", "missed", "scheduling", "state"):
        table.add_column(column, justify="left" if column in ("process", "state") else "right")
    running = lab.processes.running
    for name, part in lab.processes.parts.items():
        table.add_row(*_cells(part, loops.get(name), running=name in running))
    return table


def _cells(part: Part, loop: Loop | None, *, running: bool) -> tuple[str, ...]:
    state = "runs" if running else "ended"
    if loop is None:
        return (part.name, "", "", "", "", state)
    rate = "bursts" if loop.rate is None else f"{loop.rate:.1f}"
    requested = "" if part.rate is None else f"{part.rate:g}"
    return (part.name, rate, requested, f"{loop.missed_percent:.2f} %", loop.scheduling, state)


def title_of(row: o80.Record | None) -> str:
    """How the play goes."""
    if row is None:
        return "the environment is not there"
    words = f"{row.balls_played} balls, {row.balls_touched} touched, {row.balls_returned} returned"
    missing = [name for name in row.missing if row.missing[name]]
    return words + (f"; missing: {', '.join(missing)}" if missing else "")
