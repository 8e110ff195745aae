"""``o80 plot``: curves of a running robot or of a recording."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

import o80
from o80.cli.histories import histories
from o80.unwritable import writing


def plot(
    sources: Annotated[list[str], typer.Argument(help="Recordings (.mcap) or names of segments.")],
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Picture to write; else a window.")
    ] = None,
    fields: Annotated[
        str, typer.Option(help="For example elbow,observed.shoulder,extended.effort")
    ] = "",
    seconds: Annotated[float | None, typer.Option(help="Only the last seconds of each.")] = None,
    segment: Annotated[str | None, typer.Option(help="Only this segment of a recording.")] = None,
) -> None:
    """Plot rows: desired and observed together, sensor values, halts, late iterations.

    Each run of a robot that was restarted has panels of its own.
    """
    from o80 import plot as plots

    found = {}
    for source in dict.fromkeys(sources):
        for each in histories(source, segment, seconds=seconds):
            name = f"{each.name}/{each.number}" if each.number else each.name
            if len(each.history):
                found[f"{source}: {name}" if name in found else name] = each.history
    if not found:
        raise o80.InvalidArgument(f"{', '.join(sources)}: no rows to plot")
    chosen = [field for field in fields.split(",") if field]
    figure = plots.plot(found, chosen, window=output is None)
    if output is not None:
        known = figure.canvas.get_supported_filetypes()
        if output.suffix[1:].lower() not in known:
            raise o80.InvalidArgument(
                f"unknown format '{output.suffix}' of {output}: choose one of .png, .pdf, .svg"
            )
        with writing(output):
            figure.savefig(output, dpi=110)
        print(f"{sum(map(len, found.values()))} rows of {', '.join(found)} in {output}")
        return
    from matplotlib import pyplot

    if pyplot.get_backend().lower() == "agg":
        raise o80.InvalidArgument("there is no screen for a window: write a picture with --output")
    pyplot.show()
