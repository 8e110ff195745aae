"""``o80 export``: rows in formats that data tools read."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

import o80
from o80.cli.histories import histories
from o80.unwritable import writing


def export(
    source: Annotated[str, typer.Argument(help="A recording (.mcap), or the name of a segment.")],
    output: Annotated[
        Path, typer.Option("--output", "-o", help="File to write: .npz, .h5 or .parquet.")
    ],
    segment: Annotated[str | None, typer.Option(help="Only this segment of a recording.")] = None,
) -> None:
    """Export rows: one column for each number, named as in observed.elbow or extended.force[2]."""
    from o80.export import write

    found = list(histories(source, segment))
    if not found:
        raise o80.InvalidArgument(f"{source} holds no segment")
    restarted = {each.name for each in found if each.number > 0}
    named = {
        f"{each.name}/{each.number}" if each.name in restarted else each.name: each.history
        for each in found
    }
    with writing(output):
        write(output, named)
    for name, history in named.items():
        print(f"{name}: {len(history)} rows in {output}")
