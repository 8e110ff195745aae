"""``o80 cut`` and ``o80 merge``: recordings made of others."""

import math
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from o80.base import local_time
from o80.base.errors import Error, InvalidArgument, MissingExtra
from o80.base.screen import complain

if TYPE_CHECKING:
    from o80.recording.part import Selection
    from o80.recording.recorded_epoch import RecordedEpoch
    from o80.view.scene import Scene

_Output = Annotated[Path, typer.Option("--output", "-o", help="File to write, NAME.mcap.")]
_TIME = "10:02, 10:02:30.5, '2026-11-24 10:02' (local time), or 12.5 (seconds from its begin)"


def cut(
    recording: Annotated[Path, typer.Argument(help="A recording, or a folder of --split.")],
    output: _Output,
    begin: Annotated[str, typer.Option("--from", help=f"First time: {_TIME}.")] = "",
    end: Annotated[str, typer.Option("--to", help="Last time, in the same ways.")] = "",
    segment: Annotated[
        list[str] | None, typer.Option(help="Keep this segment only; may be repeated.")
    ] = None,
    every: Annotated[
        int, typer.Option(min=1, help="Keep every nth row only, and all decisions.")
    ] = 1,
    transforms: Annotated[
        float,
        typer.Option(
            min=0, help="Add poses of the robots' bodies for ROS tools and Foxglove [Hz], as 60."
        ),
    ] = 0.0,
    model_files: Annotated[
        bool, typer.Option("--model-files", help="Read files that the recorded models name.")
    ] = False,
) -> None:
    """Write a part of a recording into a new file."""
    from o80.recording.part import Selection
    from o80.recording.reader import open as open_recording

    found = open_recording(recording)
    first, last = found.time_range
    found.chosen(segment)
    selection = Selection(
        _time(begin, first, last, "--from") if begin else first,
        _time(end, first, last, "--to") if end else 2**63,
        frozenset(segment) if segment else None,
        every,
        transforms,
    )
    if selection.begin > (selection.end if end else last):
        if not end:
            length = f"{(last - first) * 1e-9:.4g} s"
            raise InvalidArgument(f"--from {begin} is after the end: {recording} has {length}")
        raise InvalidArgument(f"--from must be before --to, got {begin or 0} and {end}")
    _write([recording], output, selection, model_files=model_files)


def _poses(name: str, epoch: "RecordedEpoch", *, model_files: bool) -> "Scene | None":
    from o80.view.scene import Scene
    from o80.view.world import drawn

    if "model" not in epoch.schema:
        return None
    try:
        model = drawn(epoch.schema, epoch.model, trusted=model_files)
        return None if model is None else Scene(epoch.schema, model)
    except MissingExtra:
        raise
    except Error as error:
        complain(f"no transforms of '{name}': {error}")
        return None


def merge(
    recordings: Annotated[list[Path], typer.Argument(help="Recordings, at least two.")],
    output: _Output,
) -> None:
    """Write several recordings into one file; rows that several have are kept once."""
    from o80.recording.part import Selection

    _write(recordings, output, Selection())


def _write(
    recordings: list[Path], output: Path, selection: "Selection", *, model_files: bool = False
) -> None:
    from o80.recording.part import write_part

    rows = write_part(recordings, output, selection, partial(_poses, model_files=model_files))
    for name, (count, first, last) in rows.items():
        print(f"{name}: {count} rows, {first} to {last}")
    print(f"{'written to' if rows else 'no row lies there: no rows in'} {output}")


def _time(text: str, first: int, last: int, option: str) -> int:
    """Parses a log time [ns]; first, last: times of the recording, which may span several days."""
    try:
        seconds = float(text)
    except ValueError:
        instant = local_time.instant(text, within=(first, last), is_end=option == "--to")
        return local_time.nanoseconds(instant)
    if not math.isfinite(seconds * 1e9):
        raise InvalidArgument(f"{option}: write {_TIME}, not '{text}'")
    return first + round(seconds * 1e9)
