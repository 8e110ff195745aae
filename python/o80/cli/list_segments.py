"""``o80 list``: what runs on this machine."""

from __future__ import annotations

import time
from typing import Annotated, Any

import typer
from rich.markup import escape
from rich.table import Table

import o80
from o80.cli.condition import halt_text, loop_text, running_texts, start_text
from o80.cli.screen import out, print_json


def list_segments(
    as_json: Annotated[bool, typer.Option("--json", help="For scripts.")] = False,
) -> None:
    """List the backends of this machine, dead ones too."""
    rows = [_row(entry) for entry in o80.segments()]
    if as_json:
        print_json(rows)
        return
    if not rows:
        out.print("Nothing runs. Start a robot with [bold]o80 run two_joints[/bold].")
        return
    table = Table(box=None, pad_edge=False, header_style="bold")
    for name in ("segment", "robot", "state", "pace", "iteration", "pid", "user", "up"):
        table.add_column(name, justify="right" if name in ("iteration", "pid") else "left")
    for row in rows:
        table.add_row(
            row["segment"],
            row["robot"] or "?",
            _coloured(row["state"]),
            _pace(row),
            str(row["iteration"]) if row["iteration"] is not None else "",
            str(row["pid"]),
            row["user"],
            _up(row["started_at"]) if row["state"] == "running" else "",
        )
    out.print(table)
    for row in rows:
        for said in (row["halted"], row["state_of_loop"], *row["running"]):
            if said:
                out.print(f"[yellow]{row['segment']}[/]: {escape(said)}", soft_wrap=True)
        if row["problem"]:
            out.print(f"[yellow]{row['segment']}[/]: {escape(row['problem'])}")
    if any(row["state"] in ("killed", "failed", "stopped") for row in rows):
        out.print("[dim]Dead ones can still be read; [bold]o80 clean[/bold] removes them.[/dim]")


def _row(entry: o80.Segment) -> dict[str, Any]:
    row: dict[str, Any] = {
        "segment": entry.name,
        "state": entry.life if entry.readable else "unreadable",
        "problem": entry.problem,
        "pid": entry.pid,
        "user": entry.user,
        "program": entry.program,
        "started_at": entry.started_at,
        "bytes": entry.bytes,
        "robot": None,
        "frequency": None,
        "bursting": None,
        "iteration": None,
        "state_of_loop": None,
        "halted": None,
        "running": [],
    }
    if not entry.readable:
        return row
    if entry.life == "starting":
        row["state_of_loop"] = start_text(entry.started_at)
        return row  # nobody can attach to it yet
    try:
        with o80.Frontend(entry.name, timeout=0.2, read_only=True, dead=True) as frontend:
            row["robot"] = frontend.schema["robot"]
            row["frequency"] = frontend.frequency
            row["bursting"] = frontend.bursting
            row["iteration"] = frontend.published
            row["state_of_loop"] = loop_text(frontend)
            row["halted"] = halt_text(frontend)
            row["running"] = running_texts(frontend)
    except o80.Error:
        pass  # it went while we looked
    return row


def _pace(row: dict[str, Any]) -> str:
    if row["frequency"] is None:
        return ""
    return "bursting" if row["bursting"] else f"{row['frequency']:g} Hz"


def _up(started_at: int) -> str:
    seconds = max(0, int(time.time()) - started_at)
    if seconds < 120:
        return f"{seconds} s"
    if seconds < 7200:
        return f"{seconds // 60} min"
    return f"{seconds // 3600} h"


def _coloured(state: str) -> str:
    colour = {"running": "green", "starting": "yellow", "killed": "red", "failed": "red"}
    return f"[{colour[state]}]{state}[/]" if state in colour else state
