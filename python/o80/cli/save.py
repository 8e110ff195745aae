"""``o80 save`` and ``o80 repair``: recordings after the fact."""

import fnmatch
from pathlib import Path
from typing import Annotated

import typer


def save(
    names: Annotated[list[str], typer.Argument(help="Segments, alive or dead; see o80 list.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="File to write, NAME.mcap.")],
) -> None:
    """Save the rows that segments still hold, also of robots that have ended or crashed."""
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
    path: Annotated[Path, typer.Argument(help="A recording that was cut or damaged.")],
) -> None:
    """Complete a recording whose recorder was killed; keep the intact parts of a damaged one."""
    from o80.recording.output import all_files_of
    from o80.recording.reader import open as open_recording
    from o80.recording.repairing import REASON, repaired

    files = all_files_of(path)
    was_complete = True
    for each in files:
        for line in repaired(each, is_last=each == files[-1]):
            was_complete = False
            print(line)
    if was_complete:
        print(f"{path} is complete")
    recording = open_recording(path)
    for name in recording:
        for epoch in recording[name].epochs:
            for gap in epoch.gaps:
                if gap.reason == REASON:
                    print(f"{name}: {gap}")
