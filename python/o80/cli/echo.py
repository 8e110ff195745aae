"""``o80 echo``: prints rows of a robot."""

import math
import sys
import time
from collections.abc import Iterator
from typing import Annotated

import typer

import o80._core as _core
from o80._core import Observation
from o80.base.errors import InvalidArgument, TimeoutError
from o80.base.finite import json_text
from o80.base.screen import complain, complain_once, emit, style
from o80.cli.attach import attach
from o80.cli.journal_lines import follow, print_recorded
from o80.cli.numbers import not_negative, positive
from o80.cli.values import RowValues, text
from o80.frontend.backend_texts import halt_text, pace_text
from o80.frontend.frontend import Frontend

_LOOK = 1.0  # between two checks of a loop that publishes no row [s]
_BETWEEN_REMARKS = 10.0  # between two remarks about one trouble [s]


def echo(
    segment: Annotated[
        str,
        typer.Argument(help="Name of a segment; see o80 list. With --commands also a recording."),
    ],
    rate: Annotated[
        float, typer.Option(callback=positive, help="Most rows printed a second.")
    ] = 10.0,
    count: Annotated[
        int, typer.Option(min=0, help="Stop after this number of rows; 0: never.")
    ] = 0,
    every: Annotated[bool, typer.Option(help="Print every row, in order.")] = False,
    fields: Annotated[
        str, typer.Option(help="Print only these, for example observed.elbow,extended.effort")
    ] = "",
    commands: Annotated[
        bool,
        typer.Option(
            "--commands", help="Print the journal: who sent what, when it began and how it ended."
        ),
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object a line.")] = False,
    wait: Annotated[
        bool, typer.Option("--wait", help="Wait for a robot that has not started yet.")
    ] = False,
    timeout: Annotated[
        float | None,
        typer.Option(callback=not_negative, help="Seconds to wait for a row (default: for ever)."),
    ] = None,
) -> None:
    """Print rows: iteration, time, states, sensor values, active and braking actuators.

    With --commands, the last decisions of the backend and those that follow, or those in a
    recording (NAME.mcap).
    For a dead segment it prints the last rows and why the backend ended. Ctrl-C ends it.
    """
    if segment.endswith(".mcap"):
        if not commands:
            raise InvalidArgument(
                f"{segment} is a recording: `o80 echo --commands {segment}` prints its decisions, "
                f"and `o80 play {segment}` makes it a segment, whose rows o80 echo prints"
            )
        print_recorded(segment, count, as_json)
        return
    with attach(segment, wait=wait) as frontend:
        if commands:
            follow(frontend, count, as_json, timeout)
            return
        printer = _Printer(frontend, [path for path in fields.split(",") if path], as_json)
        if not frontend.alive:
            for row in frontend.history(max(count, 1)):
                printer.print(row)
            frontend.wait_for(frontend.published + 1, timeout=0)  # raises the reason of its end
        printer.print_head()
        for printed, row in enumerate(_rows(frontend, None if every else rate, timeout), 1):
            printer.print(row)
            if count and printed >= count:
                return


def _rows(frontend: Frontend, rate: float | None, timeout: float | None) -> Iterator[Observation]:
    """Yields every row (rate None), or at most `rate` rows a second; reports why none comes."""
    remarks = _Remarks(frontend)
    row = frontend.latest()
    while True:
        yield row
        if rate is not None:
            remarks.look()
            time.sleep(1.0 / rate)
        wanted = row.iteration + 1 if rate is None else max(row.iteration + 1, frontend.published)
        waited = 0.0
        while True:
            left = _LOOK if timeout is None else min(_LOOK, timeout - waited)
            try:
                row = frontend.wait_for(wanted, timeout=left)
                break
            except TimeoutError:
                waited += left
                if timeout is not None and waited >= timeout:
                    raise
                remarks.look(waits=True)


class _Remarks:
    """Remarks about halts and troubles of the loop, on stderr, at a limited rate."""

    def __init__(self, frontend: Frontend) -> None:
        self._frontend = frontend
        self._halt = 0
        self._said = ""
        self._said_at = -math.inf

    def look(self, waits: bool = False) -> None:
        """Prints a remark if the backend is halted, late, hangs or waits for a burst."""
        halt = self._frontend._halted
        number = halt[0] if halt else 0
        if number != self._halt:
            frontend = self._frontend
            said = halt_text(frontend.segment, halt, played=frontend.played)
            complain(said or "resumed")
            self._halt = number
        if time.monotonic() - self._said_at < _BETWEEN_REMARKS:
            return
        loop = _core.loop_state(self._frontend)
        said = loop.trouble
        if not said and waits and loop.bursting:
            said = f"at row {loop.last}, waits for a frontend to request iterations (burst)"
            if said == self._said:
                return
        if said:
            complain(said)
            self._said = said
            self._said_at = time.monotonic()


class _Printer:
    def __init__(self, frontend: Frontend, fields: list[str], as_json: bool) -> None:
        self._frontend = frontend
        self._values = RowValues(frontend.schema)
        self._fields = fields
        self._as_json = as_json
        if frontend.published >= 0:  # refuse an unknown field before anything is printed
            self._chosen(frontend.latest())

    def print_head(self) -> None:
        """Prints the state of the loop on stderr, so that rows can be piped; not beside JSON."""
        if not self._as_json:
            head = pace_text(_core.loop_state(self._frontend))
            print(f"{self._frontend.segment}: {head}", file=sys.stderr, flush=True)

    def _chosen(self, row: Observation) -> dict[str, object]:
        """Converts the chosen fields to plain values; all fields if none were chosen."""
        plain = self._values.plain(row)
        if not self._fields:
            return plain
        chosen = {path: self._values.choose(row, plain, path) for path in self._fields}
        return {"iteration": row.iteration, "time": row.time} | chosen

    def print(self, row: Observation) -> None:
        plain = self._chosen(row)
        emit(json_text(plain, say=complain_once) if self._as_json else self._line(row, plain))

    def _line(self, row: Observation, plain: dict[str, object]) -> str:
        parts = [f"{style(f'{row.iteration:>8}', 'bold')} {row.time * 1e-9:.3f} s"]
        if row.halted:
            parts.append(style("HALTED", "yellow"))
        names = self._fields or ["desired", "observed", "extended"]
        parts += [f"{name} {text(plain[name])}" for name in names if plain[name] not in (None, {})]
        if not self._fields:
            parts.append(self._values.acting(row))
        return "  ".join(part for part in parts if part)
