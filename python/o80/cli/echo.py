"""``o80 echo``: the rows of a robot as they come."""

from __future__ import annotations

import json
import math
import sys
import time
from collections.abc import Iterator
from typing import Annotated

import typer

import o80
from o80 import _core
from o80.cli.attach import attach
from o80.cli.condition import halt_text, pace_text
from o80.cli.screen import complain, style
from o80.cli.values import RowValues, text

_LOOK = 1.0  # between two looks at a loop from which no row comes [s]
_BETWEEN_REMARKS = 10.0  # about the same [s]


def _rate(value: float) -> float:
    if not (value > 0 and math.isfinite(value)):
        raise typer.BadParameter(
            f"rate must be positive, got {value:g}; --every prints every row", param_hint="--rate"
        )
    return value


def _timeout(value: float | None) -> float | None:
    if value is not None and not value >= 0:
        raise typer.BadParameter(
            f"timeout must not be negative, got {value:g}", param_hint="--timeout"
        )
    return value


def echo(
    segment: Annotated[str, typer.Argument(help="Name of a segment; see o80 list.")],
    rate: Annotated[
        float, typer.Option(callback=_rate, help="Rows printed a second, at most.")
    ] = 10.0,
    count: Annotated[int, typer.Option(min=0, help="Stop after so many rows; 0: never.")] = 0,
    every: Annotated[bool, typer.Option(help="Every row, in order, however many.")] = False,
    fields: Annotated[
        str, typer.Option(help="Only these, for example observed.elbow,extended.effort")
    ] = "",
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object a line.")] = False,
    wait: Annotated[
        bool, typer.Option("--wait", help="For a robot that is not there yet.")
    ] = False,
    timeout: Annotated[
        float | None,
        typer.Option(callback=_timeout, help="Seconds to wait for a row (default: for ever)."),
    ] = None,
) -> None:
    """Print rows: iteration, time, desired and observed states, sensor values, what acts.

    Of a dead segment: the last ones, and why it ended. Ctrl-C ends it.
    """
    with attach(segment, wait=wait) as frontend:
        printer = _Printer(frontend, [path for path in fields.split(",") if path], as_json)
        if not frontend.alive:
            for row in frontend.history(max(count, 1)):
                printer.print(row)
            frontend.wait_for(frontend.published + 1, timeout=0)  # raises why it ended
        printer.print_head()
        for printed, row in enumerate(_rows(frontend, None if every else rate, timeout), 1):
            printer.print(row)
            if count and printed >= count:
                return


def _rows(
    frontend: o80.Frontend, rate: float | None, timeout: float | None
) -> Iterator[o80.Observation]:
    """Rows as they come, every one or so many a second; says why none comes."""
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
            except o80.TimeoutError:
                waited += left
                if timeout is not None and waited >= timeout:
                    raise
                remarks.look(waits=True)


class _Remarks:
    """What is said beside the rows, on stderr, at a limited rate."""

    def __init__(self, frontend: o80.Frontend) -> None:
        self._frontend = frontend
        self._halt = 0
        self._said = ""
        self._said_at = -math.inf

    def look(self, waits: bool = False) -> None:
        """Says that it is halted, late, hangs or stands still."""
        halt = self._frontend._halted
        number = halt[0] if halt else 0
        if number != self._halt:
            complain(halt_text(self._frontend.segment, halt) if halt else "resumed")
            self._halt = number
        if time.monotonic() - self._said_at < _BETWEEN_REMARKS:
            return
        loop = _core.loop_state(self._frontend)
        said = loop.trouble
        if not said and waits and loop.bursting:
            said = f"stands still at row {loop.last} until a frontend asks for iterations (burst)"
            if said == self._said:
                return
        if said:
            complain(said)
            self._said = said
            self._said_at = time.monotonic()


class _Printer:
    """Prints rows of one robot."""

    def __init__(self, frontend: o80.Frontend, fields: list[str], as_json: bool) -> None:
        self._frontend = frontend
        self._values = RowValues(frontend.schema)
        self._fields = fields
        self._as_json = as_json
        if frontend.published >= 0:  # a field that there is not is refused before anything else
            plain = self._values.plain(frontend.latest())
            for path in fields:
                self._values.choose(plain, path)

    def print_head(self) -> None:
        """What runs, where rows are for people; on stderr, so that rows can be piped."""
        if not self._as_json:
            head = pace_text(_core.loop_state(self._frontend))
            print(f"{self._frontend.segment}: {head}", file=sys.stderr, flush=True)

    def print(self, row: o80.Observation) -> None:
        """One line."""
        plain = self._values.plain(row)
        if self._fields:
            chosen = {path: self._values.choose(plain, path) for path in self._fields}
            plain = {"iteration": plain["iteration"], "time": plain["time"]} | chosen
        print(json.dumps(plain) if self._as_json else self._line(row, plain), flush=True)

    def _line(self, row: o80.Observation, plain: dict[str, object]) -> str:
        parts = [f"{style(f'{row.iteration:>8}', 'bold')} {row.time * 1e-9:.3f} s"]
        if row.halted:
            parts.append(style("HALTED", "yellow"))
        names = self._fields or ["desired", "observed", "extended"]
        parts += [f"{name} {text(plain[name])}" for name in names if plain[name] not in (None, {})]
        if not self._fields:
            parts.append(self._values.acting(row))
        return "  ".join(part for part in parts if part)
