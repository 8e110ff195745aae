"""``o80 recordings``: the recordings below a folder."""

import sys
import time
import warnings
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from o80.base import local_time
from o80.base.screen import Column, bytes_text, complain, overwrite, plain, print_json, print_table
from o80.frontend.backend_texts import age_text

if TYPE_CHECKING:
    from o80.recording.catalogue import FoundRecording

COLUMNS = (
    Column("recording"),
    Column("segment"),
    Column("run", right=True, spare=1),
    Column("robot", spare=2),
    Column("began at"),
    Column("length", right=True),
    Column("rows", right=True, spare=3),
    Column("missing", right=True, spare=1),
    Column("end"),
    Column("marks", right=True),
    Column("size", right=True, spare=3),
)
_TIME = "2026-11-24, '2026-11-24 10:02', or 10:02 (today)"


def recordings(
    folder: Annotated[Path, typer.Argument(help="Recordings in it and below it are listed.")],
    begin: Annotated[str, typer.Option("--from", help=f"First time: {_TIME}.")] = "",
    end: Annotated[str, typer.Option("--to", help="Last time, in the same ways.")] = "",
    text: Annotated[
        str, typer.Option(help="Only those in whose path, segments, robots or marks it occurs.")
    ] = "",
    as_json: Annotated[bool, typer.Option("--json", help="All of it, for tools.")] = False,
) -> None:
    """List the recordings below a folder: robots, times, how runs ended, marks."""
    from o80.recording.catalogue import recordings as find

    with warnings.catch_warnings(record=True) as remarks:
        warnings.simplefilter("always", RuntimeWarning)
        found = find(
            folder,
            begin=local_time.instant(begin) if begin else None,
            end=local_time.instant(end, is_end=True) if end else None,
            text=text,
            progress=_show if sys.stderr.isatty() else None,
        )
    overwrite("")
    for remark in remarks:
        complain(str(remark.message))
    if as_json:
        print_json([_fields(each) for each in found])
        return
    rows = [row for each in found if not each.problem for row in _rows(each, folder)]
    if rows:
        print_table(COLUMNS, rows)
    for each in found:
        if each.problem:
            print(plain(f"{each.path.relative_to(folder)}: not read: {each.problem}"))
    if not found:
        chosen = " is of this time and text" if begin or end or text else ""
        print(f"no recording in {folder}{chosen}")


def _rows(found: "FoundRecording", folder: Path) -> list[list[str]]:
    """Makes a row for each run; the first row also has path, marks and size of the recording."""
    rows = []
    for i, run in enumerate(found.runs):
        local = time.localtime(run.begin * 1e-9)
        rows.append(
            [
                "" if i else plain(str(found.path.relative_to(folder))),
                plain(run.segment),
                str(run.number),
                plain(run.robot),
                time.strftime("%Y-%m-%d %H:%M:%S", local) if run.rows else "-",
                age_text((run.end - run.begin) * 1e-9) if run.rows else "-",
                str(run.rows),
                str(run.missing),
                run.ended.partition(":")[0] or "not recorded",
                "" if i else str(found.mark_count),
                "" if i else bytes_text(found.size),
            ]
        )
    return rows or [[plain(str(found.path.relative_to(folder))), *[""] * 9, bytes_text(found.size)]]


def _fields(found: "FoundRecording") -> dict[str, object]:
    marks = [{"name": name, "time": at, "values": values} for name, at, values in found.marks]
    return {**asdict(found), "path": str(found.path), "marks": marks}


def _show(number: int, of: int) -> None:
    overwrite(f"{number} of {of} recordings read")
