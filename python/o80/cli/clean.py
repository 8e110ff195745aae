"""``o80 clean``: removes dead segments."""

from __future__ import annotations

from typing import Annotated

import typer

import o80
from o80 import _core
from o80.cli.screen import complain


def clean(
    segments: Annotated[
        list[str] | None, typer.Argument(help="Names of segments (default: all dead ones).")
    ] = None,
) -> None:
    """Remove dead segments. A robot can start again without it: it takes over its dead segment.

    Segments of running backends stay.
    """
    if segments:
        _clean_named(segments)
        return
    removed = o80.clean()
    for name in removed:
        print(f"removed {name}")
    if removed:
        return
    there = o80.segments()
    if not there and (problem := _core.directory_problem()):
        raise o80.SegmentError(problem)
    counts = {
        "running": sum(entry.alive for entry in there),
        "unknown": sum(entry.life == "unknown" for entry in there),
    }
    kept = ", ".join(f"{count} {state}" for state, count in counts.items() if count)
    print(f"Nothing to remove{f' ({kept}: not removed)' if kept else ''}.")


def _clean_named(names: list[str]) -> None:
    failed = False
    known = [entry.name for entry in o80.segments()]
    for name in dict.fromkeys(names):
        # remove the others even if one cannot be removed
        try:
            if o80.clean(name):
                print(f"removed {name}")
                continue
            complain(f"there is no segment '{name}'{_core.names_instead(name, known)}")
        except o80.Error as error:
            complain(str(error))
        failed = True
    if failed:
        raise typer.Exit(1)
