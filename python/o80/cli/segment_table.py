"""The output of ``o80 list``. It uses neither NumPy nor typer, so that it starts fast."""

import os
import time
from typing import Any

import o80._core as _core
from o80.base.errors import Error, SegmentError, sentence
from o80.base.screen import Column, print_json, print_table, style
from o80.base.symptoms import page_about
from o80.frontend.backend_texts import (
    age_text,
    halt_text,
    latency_percentiles,
    latency_text,
    rate_text,
    running_texts,
)
from o80.frontend.segments import Segment
from o80.frontend.segments import segments as all_segments

_COLUMNS = (
    Column("segment"),
    Column("robot", spare=2),
    Column("state"),
    Column("rate"),
    Column("overruns", right=True),
    Column("missed", right=True, spare=1),
    Column("last row", right=True),
    Column("pid", right=True, spare=3),
    Column("user", spare=4),
    Column("up", right=True, spare=5),
)
_OF_SEGMENT = (
    *("state", "alive", "problem", "played", "pid", "user", "program", "started_at", "bytes"),
)
_OF_LOOP = (
    *("robot", "frequency", "rate", "bursting", "iteration", "overruns", "missed_ticks"),
    *("row_age", "state_of_loop", "halted"),
)
_STYLES = {
    "running": "green",
    "starting": "yellow",
    "halted": "yellow",
    "played": "green",
    "hangs": "red",
    "killed": "red",
    "unknown": "yellow",
    "failed": "red",
}


def print_segments(*, as_json: bool) -> None:
    """Prints all backends of this machine, as a table or as JSON."""
    rows = [_row(entry) for entry in all_segments()]
    if as_json:
        print_json(rows)
        return
    if not rows:
        if problem := _core.directory_problem():
            raise SegmentError(problem)
        where = f" in {os.environ['O80_DIRECTORY']}" if os.environ.get("O80_DIRECTORY") else ""
        print(f"Nothing runs{where}. Start a robot with {style('o80 run two_joints', 'bold')}.")
        return
    print_table(_COLUMNS, [_cells(row) for row in rows], _STYLES)
    for row in rows:
        latency = latency_text(row["decision_latency"], 1e9 / (row["frequency"] or 1))
        for said in (row["halted"], row["state_of_loop"], row["problem"], *row["running"], latency):
            if said:
                page = page_about(said)
                said = f"{sentence(said)} {page}" if page else said
                print(f"{style(row['segment'], 'yellow')}: {said}")
    if any(row["state"] in ("killed", "failed", "stopped") for row in rows):
        print(style("Dead segments can still be read; o80 clean removes them.", "dim"))


def _row(entry: Segment) -> dict[str, Any]:
    row: dict[str, Any] = {"segment": entry.name, "hangs": False, "running": []}
    row |= {name: getattr(entry, name) for name in _OF_SEGMENT}
    row |= {**dict.fromkeys(_OF_LOOP), "decision_latency": {}}
    if not entry.readable:
        return row
    try:
        state = _core.backend_state(entry.name)
    except Error:
        return row  # the backend has ended since
    loop = state.loop
    row |= {
        "robot": state.robot,
        "state": loop.word,
        "frequency": loop.frequency,
        "rate": loop.rate,
        "bursting": loop.bursting,
        "iteration": loop.last,
        "overruns": loop.overruns,
        "missed_ticks": loop.skipped,
        "row_age": loop.row_age,
        "hangs": entry.alive and bool(loop.hang),
        "state_of_loop": loop.trouble if entry.alive else "",
        "halted": "",
        "running": running_texts(state.running) if entry.alive else [],
        "decision_latency": latency_percentiles(state.decision_latencies),
    }
    if entry.alive:
        row["halted"] = halt_text(entry.name, state.halt, played=entry.played)
    return row


def _cells(row: dict[str, Any]) -> list[str]:
    alive = row["alive"]
    return [
        row["segment"],
        row["robot"] or "?",
        row["state"],
        _rate(row) if alive else "",
        _count(row["overruns"]),
        _count(row["missed_ticks"]),
        "" if row["row_age"] is None else age_text(row["row_age"]),
        str(row["pid"]) if row["pid"] else "",
        row["user"],
        age_text(max(0.0, time.time() - row["started_at"])) if alive else "",
    ]


def _rate(row: dict[str, Any]) -> str:
    if row["frequency"] is None or row["bursting"]:
        return "bursting" if row["bursting"] else ""
    return rate_text(row["rate"], row["frequency"])


def _count(number: int | None) -> str:
    return "" if number is None else str(number)
