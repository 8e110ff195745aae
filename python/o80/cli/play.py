"""``o80 play``: puts a recording back into shared memory."""

import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from o80.base.errors import InvalidArgument
from o80.base.screen import overwrite
from o80.base.stop_request import StopRequest
from o80.cli.numbers import not_negative, positive

if TYPE_CHECKING:
    from o80.playing.playback import Playback

_BETWEEN_REPORTS = 0.5  # [s]


def play(
    path: Annotated[Path, typer.Argument(help="A recording, NAME.mcap.")],
    segment: Annotated[
        list[str] | None, typer.Option(help="Only this segment; may be given several times.")
    ] = None,
    speed: Annotated[
        float | None, typer.Option(callback=positive, help="0.5: half as fast as recorded.")
    ] = None,
    fast: Annotated[
        bool, typer.Option("--fast", help="All rows at once; they stay until Ctrl-C.")
    ] = False,
    bursts: Annotated[
        bool,
        typer.Option("--bursts", help="Rows when frontends request iterations, as in bursting."),
    ] = False,
    loop: Annotated[
        bool, typer.Option("--loop", help="Begin again after the last row, as after a restart.")
    ] = False,
    begin: Annotated[
        float,
        typer.Option(
            "--from", callback=not_negative, help="Begin so many seconds after the first row."
        ),
    ] = 0.0,
    end: Annotated[
        float | None, typer.Option("--to", help="End so many seconds after the first row.")
    ] = None,
    prefix: Annotated[
        str, typer.Option(help="Put before the names of the segments, for example old-")
    ] = "",
    name: Annotated[
        str | None, typer.Option(help="Another name, if one segment is played.")
    ] = None,
    history: Annotated[
        int | None,
        typer.Option(help="Rows that a segment keeps (default: all, 64 MiB at most)."),
    ] = None,
    hold: Annotated[
        bool, typer.Option("--hold", help="Keep the segments after the last row, until Ctrl-C.")
    ] = False,
) -> None:
    """Play a recording: its segments appear again, for every tool and script that reads robots.

    Commands to them are refused. A segment whose name a living robot has is refused: choose another
    with --prefix or --name.
    """
    if fast and speed is not None:
        raise typer.BadParameter(
            f"--fast plays all rows at once, so it cannot be given with --speed {speed:g}",
            param_hint="--fast",
        )
    if end is not None and not end > begin:
        raise typer.BadParameter(
            f"must be later than --from ({begin:g} s), got {end:g} s", param_hint="--to"
        )
    stop = StopRequest()
    from o80.playing.playback import play as play_recording

    with play_recording(
        path,
        segment,
        speed=math.inf if fast else 1.0 if speed is None else speed,
        bursts=bursts,
        loop=loop,
        begin=begin,
        end=end,
        prefix=prefix,
        names=_names(path, segment, name),
        history=history,
        hold=True if hold else None,
    ) as playback:
        how = "; rows come when a frontend requests iterations" if bursts else ""
        head = f"playing {playback.duration:.1f} s of {', '.join(playback.names)}{how}"
        print(head, file=sys.stderr, flush=True)
        _follow(playback, stop)
        holds = playback.done and (hold or fast) and not bursts
        if holds and not stop.requested:
            print("played; Ctrl-C ends", file=sys.stderr, flush=True)
        while holds and not stop.requested:
            stop.wait(_BETWEEN_REPORTS)


def _names(path: Path, segments: list[str] | None, name: str | None) -> dict[str, str]:
    if name is None:
        return {}
    from o80.recording.reader import open as open_recording

    found = segments or list(open_recording(path))
    if len(found) != 1:
        raise InvalidArgument(
            f"--name is for one segment, and {len(found)} are played ({', '.join(found)}): choose "
            f"one with --segment, or rename all with --prefix"
        )
    return {found[0]: name}


def _follow(playback: "Playback", stop: StopRequest) -> None:
    """Prints the progress of a playback, repeatedly on a terminal."""
    while not stop.requested and not playback.wait(0.05):
        if sys.stderr.isatty():
            overwrite(f"{playback.position:.1f} of {playback.duration:.1f} s, {playback.rows} rows")
            stop.wait(_BETWEEN_REPORTS)
    overwrite(f"{playback.rows} rows", end="\n")
