"""``o80 replay``: starts recorded robots again and compares every row."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from o80.base.errors import Error
from o80.base.screen import complain, overwrite, plain
from o80.base.symptoms import see
from o80.cli.attach import attach
from o80.cli.diff import Ignore, Tolerance, tolerances_of

_ENOUGH = 1000  # rows for a speed that is not that of the start


def replay(
    recording: Annotated[
        str, typer.Argument(help="A recording (.mcap, or a folder), or a segment.")
    ],
    segment: Annotated[
        str | None, typer.Option(help="Replay only this segment of a recording.")
    ] = None,
    robot: Annotated[
        list[str] | None,
        typer.Option(
            help="Name or library (.so) of another robot than the recorded one; NAME=LIBRARY: "
            "instead of robot NAME."
        ),
    ] = None,
    option: Annotated[
        list[str] | None,
        typer.Option(
            "--set", help="NAME=VALUE: another option of the robot than the recorded one."
        ),
    ] = None,
    since: Annotated[
        int | None,
        typer.Option(
            help="Begin at the first reset or snapshot (restored, or at rest) of this iteration "
            "or later."
        ),
    ] = None,
    without_driver: Annotated[
        bool,
        typer.Option(
            "--without-driver",
            help="Start no robot: compare the desired states that follow from the recorded "
            "readings, as for hardware.",
        ),
    ] = False,
    ignore: Ignore = "",
    tolerance: Tolerance = None,
    exact: Annotated[
        bool, typer.Option("--exact", help="Bit for bit, also if another build of o80 recorded it.")
    ] = False,
) -> None:
    """Start recorded robots again, repeat their decisions, and compare every row bit for bit.

    Exit code 0: all rows are identical. 1: a row differs, and the first one is printed. 2: not all
    rows could be compared (rows or decisions are missing, or this o80 moves by other rules), and
    those that were are identical; or the recording or a robot could not be used.
    """
    from o80.replaying.replay import replay as replay_all

    is_file = recording.endswith(".mcap") or Path(recording).exists()
    try:
        report = replay_all(
            recording if is_file else attach(recording),
            segment=segment,
            robot=_robot(robot),
            options=_options(option),
            since=since,
            driver=not without_driver,
            ignore=tuple(name for name in ignore.split(",") if name),
            tolerances=tolerances_of(tolerance) if tolerance or exact else None,
            progress=_show if sys.stderr.isatty() else None,
        )
    except Error as error:  # 1 means that a row differs
        complain(str(error))
        raise typer.Exit(2) from None
    overwrite("")
    for run in report:
        print(plain(str(run)))
        for note in run.notes:
            print(f"  note: {plain(note)}")
        if run.rows >= _ENOUGH and run.seconds > 0:
            speed = run.recorded_seconds / run.seconds
            print(f"  {run.rows / run.seconds:.0f} rows/s, {speed:.3g} times as fast as it ran")
    if report.difference is not None:
        print(see("replay_differs"))
        raise typer.Exit(1)
    if not report.identical or any(run.unused for run in report):
        raise typer.Exit(2)


def _robot(texts: list[str] | None) -> str | dict[str, str] | None:
    named = {}
    for text in texts or []:
        name, equals, library = text.partition("=")
        if equals and "/" not in name:
            named[name] = library
        elif len(texts or []) == 1:
            return text
        else:
            raise typer.BadParameter(
                f"write NAME=LIBRARY to replace several robots, not '{text}'", param_hint="--robot"
            )
    return named or None


def _options(texts: list[str] | None) -> dict[str, str]:
    found = {}
    for text in texts or []:
        name, equals, value = text.partition("=")
        if not equals:
            raise typer.BadParameter(
                f"write NAME=VALUE, for example gain=2, not '{text}'", param_hint="--set"
            )
        found[name] = value
    return found


def _show(segment: str, rows: int, of: int) -> None:
    overwrite(f"{segment}: {rows} of {of} rows")
