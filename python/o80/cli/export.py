"""``o80 export``: rows in formats that data tools and learners read."""

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from o80.base.errors import InvalidArgument
from o80.base.screen import complain
from o80.base.unwritable import writing
from o80.cli.histories import histories

Format = Literal["lerobot", "minari"]


def export(
    source: Annotated[str, typer.Argument(help="A recording (.mcap), or the name of a segment.")],
    output: Annotated[
        Path,
        typer.Option(
            "--output",
            "-o",
            help="File to write: .npz, .h5, .parquet or .csv; with --format a folder.",
        ),
    ],
    segment: Annotated[str | None, typer.Option(help="Only this segment of a recording.")] = None,
    fields: Annotated[
        str, typer.Option(help="Only these, for example observed.elbow,extended.effort.")
    ] = "",
    form: Annotated[
        Format | None,
        typer.Option("--format", help="A data set for learning, of the marked episodes."),
    ] = None,
    every: Annotated[
        str,
        typer.Option(help="With --format: a step of the data set, iterations or seconds (0.1)."),
    ] = "1",
    sensors: Annotated[
        str, typer.Option(help="With --format: these sensor values, for example measured.velocity.")
    ] = "",
    state: Annotated[
        str, typer.Option(help="With --format lerobot: only these actuators in observation.state.")
    ] = "",
    action: Annotated[
        str, typer.Option(help="With --format lerobot: only these actuators in action.")
    ] = "",
    units: Annotated[
        str,
        typer.Option(
            help="With --format lerobot: degrees, normalised or native (by default those of "
            "LeRobot's driver of the arm)."
        ),
    ] = "",
    action_is: Annotated[
        str,
        typer.Option(
            help="With --format lerobot: 'acted', the desired states, or 'asked', the targets."
        ),
    ] = "",
) -> None:
    """Export rows: one column for each number, named as in observed.elbow or extended.force[2].

    With --format, the episodes of a recording as a data set for learning: see
    docs/recording/exporting.md.
    """
    of_lerobot = {
        "state": _listed(state),
        "action": _listed(action),
        "units": units,
        "action_is": action_is,
    }
    of_lerobot = {name: given for name, given in of_lerobot.items() if given}
    if of_lerobot and form != "lerobot":
        name = next(iter(of_lerobot)).replace("_", "-")
        raise InvalidArgument(f"--{name} is for data sets of LeRobot: give --format lerobot too")
    if form is not None:
        if fields:
            raise InvalidArgument("--fields is for files: a data set has --sensors")
        _export_episodes(source, output, segment, form, _time(every), _listed(sensors), of_lerobot)
        return
    for name, given in (("every", every != "1"), ("sensors", sensors)):
        if given:
            raise InvalidArgument(f"--{name} is for data sets: give --format lerobot or minari too")
    from o80.datasets.export import write

    found = list(histories(source, segment))
    if not found:
        raise InvalidArgument(f"{source} has no segment: no robot ran meanwhile")
    restarted = {each.name for each in found if each.number > 0}
    named = {
        f"{each.name}/{each.number}" if each.name in restarted else each.name: each.history
        for each in found
    }
    with writing(output):
        write(output, named, _listed(fields), complain)
    for name, history in named.items():
        print(f"{name}: {len(history)} rows in {output}")


def _time(text: str) -> float:
    """Parses a whole number as iterations, another number as seconds."""
    try:
        return int(text) if text.isdecimal() else float(text)
    except ValueError:
        raise typer.BadParameter(
            f"write iterations (20) or seconds (0.1), not '{text}'", param_hint="--every"
        ) from None


def _listed(fields: str) -> list[str]:
    return [field for field in fields.split(",") if field]


def _export_episodes(
    source: str,
    output: Path,
    segment: str | None,
    form: Format,
    every: float,
    sensors: list[str],
    of_lerobot: Mapping[str, Any],
) -> None:
    from o80.datasets import lerobot, minari
    from o80.datasets.episodes import episodes_of
    from o80.recording.reader import open as open_recording

    is_lerobot = form == "lerobot"
    fields = [] if is_lerobot else sensors
    episodes = episodes_of(open_recording(source), segment, every=every, fields=fields)
    with writing(output):
        if is_lerobot:
            lerobot.write(output, episodes, complain, sensors=sensors, **of_lerobot)
        else:
            minari.write(output, episodes, complain)
    for why in episodes.left_out:
        complain(f"left out: {why}")
    steps = sum(len(episode) for episode in episodes.all)
    print(
        f"{episodes.segment}: {len(episodes.all)} episodes, {steps} steps at "
        f"{episodes.frequency:g} a second in {output}"
    )
    if not is_lerobot:
        print(f"read it with minari.MinariDataset('{output}/data')", file=sys.stderr)
