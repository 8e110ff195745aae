"""``o80 plot``: curves of a running robot or of a recording."""

from pathlib import Path
from typing import Annotated

import typer

from o80.base.errors import InvalidArgument
from o80.base.screen import complain
from o80.base.unwritable import writing
from o80.cli.histories import Named, histories


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
    """Plot rows: desired and observed together, sensor values, halts, late iterations, ends of
    commands, what chunks planned, marks of a recording, the delay of decisions (if no --fields are
    chosen).

    Each run of a robot that was restarted has panels of its own. Runs of different times begin at 0
    each.
    """
    from o80.joining import plot as plots
    from o80.joining.plot import origins
    from o80.rows.journal import command_ends, decisions
    from o80.rows.plans import planned_by_chunks

    found: dict[str, Named] = {}
    for source in dict.fromkeys(sources):
        for each in histories(source, segment, seconds=seconds):
            if len(each.history):
                found[f"{source}: {each.title}" if each.title in found else each.title] = each
    if not found:
        raise InvalidArgument(f"{', '.join(sources)}: no rows to plot")
    offset_of: dict[str, int | None] = {}  # one for each boot: the wall clock may have been set
    placed = {
        name: (each.history, offset_of.setdefault(each.boot or name, each.wall_offset))
        for name, each in found.items()
    }
    zeros, axes = origins(placed)
    journals = {name: each.journal() for name, each in found.items()}
    wanted = [field for field in fields.split(",") if field]
    figure = plots.plot(
        {name: each.history for name, each in found.items()},
        wanted,
        ends={name: command_ends(entries) for name, entries in journals.items()},
        marks={name: each.marks for name, each in found.items()},
        decided={} if wanted else {name: decisions(each) for name, each in journals.items()},
        planned={
            name: planned_by_chunks(entries, found[name].history)
            for name, entries in journals.items()
        },
        origins=zeros,
        label="time [s]" if axes == 1 else f"time since each of {axes} beginnings [s]",
        window=output is None,
    )
    if axes > 1:
        complain(f"the runs were not recorded at the same time: each of the {axes} begins at 0")
    if output is not None:
        known = figure.canvas.get_supported_filetypes()
        if output.suffix[1:].lower() not in known:
            raise InvalidArgument(
                f"unknown format '{output.suffix}' of {output}: choose one of .png, .pdf, .svg"
            )
        with writing(output):
            figure.savefig(output, dpi=110)
        rows = sum(len(each.history) for each in found.values())
        print(f"{rows} rows of {', '.join(found)} in {output}")
        return
    from matplotlib import pyplot

    if pyplot.get_backend().lower() == "agg":
        raise InvalidArgument("there is no screen for a window: write a picture with --output")
    pyplot.show()
