"""``o80 stop``: ends backends in order."""

from __future__ import annotations

import os
import signal
import time
from typing import Annotated

import typer

import o80
from o80.cli.screen import out


def stop(
    segments: Annotated[list[str] | None, typer.Argument(help="Names of segments.")] = None,
    every: Annotated[bool, typer.Option("--all", help="All backends that run.")] = False,
    timeout: Annotated[float, typer.Option(help="Seconds to wait for the end.")] = 5.0,
) -> None:
    """Stop backends in order: their drivers are stopped, frontends are told."""
    alive = {entry.name: entry for entry in o80.segments() if entry.life in ("running", "starting")}
    names = list(alive) if every else (segments or [])
    if not names:
        if every:
            out.print("Nothing runs.")
            return
        raise o80.InvalidArgument("name the segments to stop (see `o80 list`), or give --all")
    for name in names:
        if name not in alive:
            there = ", ".join(alive) or "none"
            raise o80.InvalidArgument(f"no backend '{name}' runs; running: {there}")
    for name in names:
        _stop(alive[name], timeout)
        out.print(f"{name} has stopped")


def _stop(entry: o80.Segment, timeout: float) -> None:
    os.kill(entry.pid, signal.SIGTERM)
    end = time.monotonic() + timeout
    while time.monotonic() < end:
        now = {each.name: each for each in o80.segments()}.get(entry.name)
        if now is None or now.epoch != entry.epoch or now.life not in ("running", "starting"):
            return
        time.sleep(0.01)
    raise o80.TimeoutError(
        f"'{entry.name}' (pid {entry.pid}) did not stop in {timeout:g} s: its driver may hang; "
        f"give more --timeout, or end it with `kill -9 {entry.pid}` and `o80 clean`"
    )
