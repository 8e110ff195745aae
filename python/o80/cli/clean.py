"""``o80 clean``: removes what the dead left behind."""

from __future__ import annotations

from typing import Annotated

import typer

import o80
from o80 import _core
from o80.cli.screen import complain


def clean(
    segments: Annotated[
        list[str] | None, typer.Argument(help="Names of segments; none: all dead ones.")
    ] = None,
) -> None:
    """Remove dead segments. Never needed to start again: a new backend takes a dead name over.

    Living ones are left alone.
    """
    if segments:
        _clean_named(segments)
        return
    removed = o80.clean()
    for name in removed:
        print(f"removed {name}")
    if removed:
        return
    living = [entry.name for entry in o80.segments() if entry.alive]
    running = f" ({len(living)} running: left alone)" if living else ""
    print(f"Nothing to remove{running}.")


def _clean_named(names: list[str]) -> None:
    failed = False
    known = [entry.name for entry in o80.segments()]
    for name in dict.fromkeys(names):
        # one that cannot be removed keeps none of the others
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
