"""``o80 clean``: removes what the dead left behind."""

from __future__ import annotations

from typing import Annotated

import typer

import o80
from o80.cli.screen import out


def clean(
    segments: Annotated[
        list[str] | None, typer.Argument(help="Names of segments; none: all dead ones.")
    ] = None,
) -> None:
    """Remove dead segments. Never needed to start again: a new backend takes a dead name over.

    Living ones are left alone.
    """
    if segments:
        removed = [name for each in segments for name in o80.clean(each)]
        for name in set(segments) - set(removed):
            out.print(f"there is no segment '{name}'")
    else:
        removed = o80.clean()
    for name in removed:
        out.print(f"removed {name}")
    if not removed and not segments:
        out.print("Nothing to remove.")
