"""``o80 info run.mcap``: describes a recording."""

import time
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import o80._core as _core
from o80.base.screen import Column, bytes_text, plain, print_json, print_table, style
from o80.frontend.backend_texts import (
    age_text,
    clipped_text,
    latency_percentiles,
    latency_text,
    starved_text,
)
from o80.rows.provenance import started_with

if TYPE_CHECKING:
    from o80.recording.marks import Mark
    from o80.recording.reader import RecordingFile
    from o80.recording.recorded_epoch import RecordedEpoch

MARKS_AT_ENDS = 10  # marks listed at the beginning and at the end
LONGEST_VALUE = 60  # of a mark [characters]
GAPS = 10  # gaps listed for each run
MAX_ENTRIES = 200_000  # newest entries of a journal that are read for the decision latency
COLUMNS = (
    Column("segment"),
    Column("run", right=True),
    Column("robot"),
    Column("recorded at", spare=1),
    Column("from row", right=True, spare=3),
    Column("rows", right=True),
    Column("length", right=True),
    Column("missing", right=True),
    Column("decisions", spare=2),
    Column("end"),
)


def recording_info(path: Path, *, as_json: bool = False) -> None:
    """Prints the contents of a recording. Raises RecordingError if it cannot be read."""
    from o80.recording.reader import open as open_recording

    recording = open_recording(path)
    runs = [*recording.runs()]
    if as_json:
        print_json([_fields(name, number, epoch) for name, number, epoch in runs])
        return
    print(_first_line(recording))
    if runs:
        print()
        print_table(COLUMNS, [_row(name, number, epoch) for name, number, epoch in runs])
    for line in [line for run in runs for line in _missing(*run)]:
        print(plain(line))
    for name, number, epoch in runs:
        latency = latency_text(latency_of(epoch), epoch.schema["period"])
        clipped = clipped_text(_last_entries(epoch))
        for line in (latency, clipped, starved_text(starvations_of(epoch))):
            if line:
                print(plain(f"{_of_run(name, number)}: {line}"))
    _print_marks(recording.marks)
    _print_starts(runs)


def _brief(value: object) -> str:
    text = repr(value)
    return text if len(text) <= LONGEST_VALUE else f"{text[: LONGEST_VALUE - 3]}..."


def _print_marks(marks: "list[Mark]") -> None:
    """Prints marks with time and values; of many only the first and the last ones."""
    if not marks:
        return
    print(style(f"\n{len(marks)} mark{'s' if len(marks) > 1 else ''}", "bold"))
    skipped = len(marks) - 2 * MARKS_AT_ENDS
    for i, mark in enumerate(marks):
        if skipped > 0 and MARKS_AT_ENDS <= i < len(marks) - MARKS_AT_ENDS:
            if i == MARKS_AT_ENDS:
                print(f"  ... {skipped} more, see o80.open(...).marks")
            continue
        local = time.localtime(mark.row_time * 1e-9)
        clock = f"{time.strftime('%H:%M:%S', local)}.{mark.row_time // 10**6 % 1000:03d}"
        values = ", ".join(f"{name}={_brief(value)}" for name, value in mark.values.items())
        print(plain(f"  {clock}  {mark.name}  {values}").rstrip())


def _print_starts(runs: "list[tuple[str, int, RecordedEpoch]]") -> None:
    """Prints how the runs were started, runs with equal options together."""
    starts: dict[tuple[str, ...], list[str]] = {}
    for name, number, epoch in runs:
        start = (name, *started_with(epoch.provenance))
        starts.setdefault(start, []).append(str(number))
    for (name, *lines), numbers in starts.items():
        several = f"runs {', '.join(numbers)}" if len(numbers) > 1 else f"run {numbers[0]}"
        print(style(f"\n{plain(name)}, {several}: started with", "bold"))
        for line in lines:
            print(f"  {line}")


def _first_line(recording: "RecordingFile") -> str:
    state = "finished"
    if not recording.finished:
        state = (
            f"read up to its last whole chunk: its recorder still runs, or was killed (then "
            f"`o80 repair {recording.path}` completes it for other readers)"
        )
    count = len(recording)
    segments = f"{count} segment{'' if count == 1 else 's'}"
    name, size = style(plain(str(recording.path)), "bold"), bytes_text(recording.size)
    return f"{name}: {segments}, {size}, {state}"


def _row(name: str, number: int, epoch: "RecordedEpoch") -> list[str]:
    from o80.recording.catalogue import run_found

    run = run_found(name, number, epoch)
    local = time.localtime(epoch.recorded_at * 1e-9)
    return [
        plain(name),
        str(number),
        plain(run.robot),
        time.strftime("%Y-%m-%d %H:%M:%S", local),
        str(epoch.first_row),
        str(run.rows),
        age_text((run.end - run.begin) * 1e-9) if run.rows else "-",
        str(run.missing),
        _decisions(epoch.journal_codec),
        run.ended.partition(":")[0] or "not recorded",
    ]


def _decisions(codec: int | None) -> str:
    if codec is None:
        return "none"
    return "recorded" if codec <= _core.JOURNAL_CODEC else f"for a newer o80 (format {codec})"


def _of_run(name: str, number: int) -> str:
    return name if number == 0 else f"{name}/{number}"


def latency_of(epoch: "RecordedEpoch") -> dict[str, int]:
    """Computes the decision latency from the last entries of the journal, of recorded rows."""
    from o80.rows.journal import latencies_of

    return latency_percentiles(latencies_of(_last_entries(epoch)))


def _last_entries(epoch: "RecordedEpoch") -> "list[_core.JournalEntry]":
    """Reads the last journal entries of recorded rows; none if a newer o80 wrote the journal."""
    rows = range(epoch.first_row, epoch.next_row)
    return [each for each in epoch.last_entries(MAX_ENTRIES) if each.iteration in rows]


def starvations_of(epoch: "RecordedEpoch") -> int:
    """Counts how often a plan of chunks ran out of rows, up to the last recorded row."""
    last = epoch.history(1).starvations
    return int(last[0]) if len(last) else 0


def _missing(name: str, number: int, epoch: "RecordedEpoch") -> list[str]:
    """Lists gaps and their reasons, a line each; only the first ones if there are many."""
    of_run = _of_run(name, number)
    lines = [f"{of_run}: {epoch.interruption}"] if epoch.interruption else []
    lines += [f"{of_run}: {gap}" for gap in epoch.gaps[:GAPS]]
    more = len(epoch.gaps) - GAPS
    return [*lines, f"{of_run}: and {more} more gaps, see --json"] if more > 0 else lines


def _fields(name: str, number: int, epoch: "RecordedEpoch") -> dict[str, Any]:
    """Describes a run, for tools."""
    begin, end = epoch.time_range if epoch.rows else (0, 0)
    return {
        "segment": name,
        "run": number,
        "robot": epoch.schema["robot"],
        "recorded_at": epoch.recorded_at,
        "first_row": epoch.first_row,
        "rows": epoch.rows,
        "seconds": (end - begin) * 1e-9,
        "missing": epoch.missing,
        "decisions": epoch.has_journal,
        "journal_codec": epoch.journal_codec,
        "end": epoch.end,
        "gaps": [gap._asdict() for gap in epoch.gaps],
        "interruption": str(epoch.interruption or ""),
        "decision_latency": latency_of(epoch),
        "starvations": starvations_of(epoch),
        "schema": epoch.schema,
        "provenance": asdict(epoch.provenance),
    }
