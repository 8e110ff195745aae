"""``o80 stop``: stops backends in order."""

from typing import Annotated

import typer

import o80._core as _core
from o80.base.errors import Error, InvalidArgument, SegmentError
from o80.base.screen import complain
from o80.frontend.segments import segments as all_segments
from o80.frontend.stopping import stop as stop_backend


def stop(
    segments: Annotated[list[str] | None, typer.Argument(help="Names of segments.")] = None,
    every: Annotated[bool, typer.Option("--all", help="All running backends.")] = False,
    timeout: Annotated[float, typer.Option(help="Seconds to wait for the end of each.")] = 5.0,
) -> None:
    """Stop backends in order: robots brake, drivers stop, frontends raise BackendStopped."""
    there = all_segments() if every else []
    names = [entry.name for entry in there if entry.alive] if every else (segments or [])
    unseen = [entry.name for entry in there if entry.life == "unknown"]
    if unseen:
        complain(f"not stopped, because it is unknown whether they run: {', '.join(unseen[:5])}")
    if not names:
        if every:
            if not there and (problem := _core.directory_problem()):
                raise SegmentError(problem)
            print("Nothing that this user can see runs." if unseen else "Nothing runs.")
            return
        raise InvalidArgument("name the segments to stop (see `o80 list`), or give --all")
    failed = False
    for name in dict.fromkeys(names):
        # stop the others even if one cannot be stopped
        try:
            stop_backend(name, timeout)
        except Error as error:
            complain(str(error))
            failed = True
        else:
            print(f"{name} has stopped")
    if failed:
        raise typer.Exit(1)
