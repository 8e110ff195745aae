"""``o80 clean``: removes dead segments."""

from typing import Annotated

import typer

import o80._core as _core
from o80.base.errors import Error, SegmentError
from o80.base.screen import complain
from o80.frontend.segments import clean as clean_segments
from o80.frontend.segments import segments as all_segments


def clean(
    segments: Annotated[
        list[str] | None, typer.Argument(help="Names of segments (default: all dead ones).")
    ] = None,
) -> None:
    """Remove dead segments. A robot can restart without this: it takes over its dead segment.

    Segments of running backends stay.
    """
    if segments:
        _clean_named(segments)
        return
    removed = clean_segments()
    for name in removed:
        print(f"removed {name}")
    if removed:
        return
    there = all_segments()
    if not there and (problem := _core.directory_problem()):
        raise SegmentError(problem)
    counts = {
        "running": sum(entry.alive for entry in there),
        "unknown": sum(entry.life == "unknown" for entry in there),
    }
    kept = ", ".join(f"{count} {state}" for state, count in counts.items() if count)
    print(f"Nothing to remove{f' ({kept}: not removed)' if kept else ''}.")


def _clean_named(names: list[str]) -> None:
    failed = False
    known = [entry.name for entry in all_segments()]
    for name in dict.fromkeys(names):
        # remove the others even if one cannot be removed
        try:
            if clean_segments(name):
                print(f"removed {name}")
                continue
            complain(f"there is no segment '{name}'{_core.names_instead(name, known)}")
        except Error as error:
            complain(str(error))
        failed = True
    if failed:
        raise typer.Exit(1)
