"""``o80 echo``: the rows of a robot as they come."""

from __future__ import annotations

import json
import math
import sys
import time
from typing import Annotated, Any

import numpy as np
import typer

import o80
from o80.cli.screen import out


def _rate(value: float) -> float:
    if not (value > 0 and math.isfinite(value)):
        raise typer.BadParameter(
            f"rate must be positive, got {value:g}; --every prints every row", param_hint="--rate"
        )
    return value


def echo(
    segment: Annotated[str, typer.Argument(help="Name of a segment; see o80 list.")],
    rate: Annotated[
        float, typer.Option(callback=_rate, help="Rows printed a second, at most.")
    ] = 10.0,
    count: Annotated[int, typer.Option(min=0, help="Stop after so many rows; 0: never.")] = 0,
    every: Annotated[bool, typer.Option(help="Every row, in order, however many.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object a line.")] = False,
    timeout: Annotated[float, typer.Option(help="Seconds to wait for a row.")] = 5.0,
) -> None:
    """Print observations: iteration, time, desired and observed states, sensor values.

    Of a dead segment: the last ones, and why it ended.
    """
    with o80.Frontend(segment, timeout=timeout, read_only=True, dead=True) as frontend:
        if not frontend.alive:
            for row in frontend.history(max(count, 1)):
                _print(row, as_json)
            frontend.wait_for(frontend.published + 1, timeout=timeout)  # raises why it ended
        row = frontend.latest()
        printed = 0
        while True:
            _print(row, as_json)
            printed += 1
            if count and printed >= count:
                return
            if every:
                row = frontend.wait_for(row.iteration + 1, timeout=timeout)
            else:
                time.sleep(1.0 / rate)
                row = frontend.wait_for(max(row.iteration + 1, frontend.published), timeout=timeout)


def _print(row: o80.Observation, as_json: bool) -> None:
    if as_json:
        json.dump(_plain(row), sys.stdout)
        sys.stdout.write("\n")
        sys.stdout.flush()
        return
    sensors = "" if row.extended is None else f"  extended {_short(row.extended)}"
    out.print(
        f"[bold]{row.iteration:>10}[/bold] {row.time * 1e-9:14.6f} s"
        f"{'  [yellow]HALTED[/]' if row.halted else ''}"
        f"  desired {_short(row.desired)}  observed {_short(row.observed)}{sensors}",
        soft_wrap=True,
        markup=True,
    )


def _plain(row: o80.Observation) -> dict[str, Any]:
    return {
        "iteration": row.iteration,
        "time": row.time,
        "desired": _values(row.desired),
        "observed": _values(row.observed),
        "extended": None if row.extended is None else _values(row.extended),
        "active": [bool(value) for value in row.active],
        "clamped": [bool(value) for value in row.clamped],
        "braking": [bool(value) for value in row.braking],
        "halted": row.halted,
    }


def _values(value: Any) -> Any:
    """Arrays, records and groups as plain lists and dictionaries."""
    if isinstance(value, o80.Record):
        return {name: _values(value[name]) for name in value}
    if isinstance(value, (np.ndarray, np.void)) and value.dtype.names:
        return {name: _values(value[name]) for name in value.dtype.names}
    return value.tolist() if isinstance(value, (np.ndarray, np.generic)) else value


def _short(value: Any) -> str:
    """A state block in one line."""
    plain = _values(value)
    if isinstance(plain, dict):
        return " ".join(f"{name} {_numbers(each)}" for name, each in plain.items())
    return _numbers(plain)


def _numbers(value: Any) -> str:
    if isinstance(value, dict):
        return "{" + _short(value) + "}"
    if isinstance(value, list):
        return "(" + " ".join(_numbers(each) for each in value) + ")"
    if isinstance(value, float):
        return f"{value:.4g}"
    return str(value)
