"""``o80 save`` and ``o80 repair``: recordings after the fact."""

from __future__ import annotations

import fnmatch
from pathlib import Path
from typing import Annotated

import typer


def save(
    names: Annotated[list[str], typer.Argument(help="Segments, alive or dead; see o80 list.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="File to write, NAME.mcap.")],
) -> None:
    """Save what segments still hold, also those of robots that have ended or crashed."""
    from o80.base.errors import SegmentError
    from o80.frontend.segments import segments as all_segments
    from o80.recording.recorder import Recorder

    there = {segment.name for segment in all_segments() if segment.readable}
    for name in names:
        if not any(sign in name for sign in "*?[") and name not in there:
            raise SegmentError(f"there is no segment '{name}' (see `o80 list`)")
        if not any(fnmatch.fnmatchcase(segment, name) for segment in there):
            raise SegmentError(f"no segment matches '{name}' (see `o80 list`)")
    recorder = Recorder(output, names)
    try:
        recorder.catch_up()
    finally:
        recorder.finish()
    print(f"{recorder.rows} rows of {', '.join(recorder.sources)} in {output}")


def repair(
    path: Annotated[Path, typer.Argument(help="A recording that was cut.")],
) -> None:
    """Complete a recording whose recorder was killed, so that every MCAP reader opens it."""
    from o80.recording.output import opened, unfinished_in

    unfinished = unfinished_in(path)
    if not unfinished:
        print(f"{path} is complete")
    for each in unfinished:
        size = each.stat().st_size
        file = opened(each, proceed=True)
        kept = file.kept
        file.finish()
        print(f"{each} is complete now: {kept} bytes kept, {size - kept} bytes behind them removed")
