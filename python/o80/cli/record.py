"""``o80 record``: writes rows and journals of segments to a file."""

import sys
import time
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from o80.base.screen import bytes_text, complain, overwrite
from o80.base.stop_request import StopRequest
from o80.cli.numbers import positive

if TYPE_CHECKING:
    from o80.frontend.frontend import Frontend
    from o80.recording.recorder import Recorder
    from o80.recording.source import Source

_BETWEEN_REPORTS = 0.5  # [s]


def record(
    names: Annotated[
        list[str], typer.Argument(help="Segments; a pattern such as 'arm*' includes later ones.")
    ],
    output: Annotated[
        Path,
        typer.Option("--output", "-o", help="File to write, NAME.mcap; a folder with --split."),
    ],
    seconds: Annotated[
        float | None, typer.Option(callback=positive, help="Stop after this many seconds.")
    ] = None,
    size: Annotated[
        str | None, typer.Option(help="Stop when the recording has this size, for example 2G.")
    ] = None,
    split: Annotated[
        str | None,
        typer.Option(
            help="Go on in a new file after this size or time: 500M, 2G, 600s, 10min, 1h."
        ),
    ] = None,
    keep: Annotated[
        str | None,
        typer.Option(
            help="With --split: delete the oldest files without marks, to hold no more than this."
        ),
    ] = None,
    snapshots: Annotated[
        float | None,
        typer.Option(
            callback=positive,
            help="Seconds between two snapshots of a simulation: a replay can begin there.",
        ),
    ] = None,
    proceed: Annotated[
        bool, typer.Option("--continue", help="Append to the file, also to one that was cut.")
    ] = False,
    from_now: Annotated[
        bool,
        typer.Option(
            "--from-now", help="Begin with the newest row, not with the oldest that is there."
        ),
    ] = False,
    compression: Annotated[str, typer.Option(help="zstd, lz4 or none.")] = "zstd",
    joint_states: Annotated[
        Literal["on", "off"],
        typer.Option(help="Rows of robots with joints also as sensor_msgs/JointState."),
    ] = "on",
) -> None:
    """Record rows and decisions of robots to an MCAP file until Ctrl-C.

    Waits for robots that have not started; a robot that restarts continues in the same file.
    """
    from o80.recording.file_writer import Form
    from o80.recording.recorder import Recorder, size_of

    form = Form(compression, joint_states == "on")
    most = None if size is None else size_of(size, "size")
    end = StopRequest()
    warnings.showwarning = lambda message, *_, **__: complain(str(message))
    recorder = Recorder(
        output,
        names,
        proceed=proceed,
        from_now=from_now,
        split=split,
        keep=keep,
        snapshots=snapshots,
        form=form,
    )
    report = _Report(recorder, from_now)
    begin = time.monotonic()
    try:
        while not end.requested:
            started = time.monotonic()
            if recorder.is_due():
                recorder.poll()
            report.show()
            if seconds is not None and started - begin >= seconds:
                break
            if most is not None and recorder.size >= most:
                break
            busy = any(source.behind for source in recorder.sources.values())
            if not busy:
                end.wait(max(0.0, recorder.between_chunks - (time.monotonic() - started)))
        recorder.catch_up()
    finally:
        recorder.finish()
    report.show(last=True)


def _replay_text(source: "Source", frontend: "Frontend", from_now: bool) -> str:
    """Returns from which row on a run is recorded, and from where it can be replayed."""
    from o80.replaying.conditions import reads_the_world

    if source.journal_begin is None:
        return "cannot be replayed: it was started without a journal"
    if source.begin > 0 and source.continues_at is not None:
        return f"continues with row {source.continues_at}; `o80 info` lists what was recorded"
    alone = " without its driver" if reads_the_world(frontend.schema) else ""
    if source.begin == 0 and source.journal_begin == 0:
        return f"is recorded from row 0: the recording can be replayed{alone}"
    if source.begin == 0:
        why = (
            "is recorded from row 0, but its first decisions were overwritten (a larger --journal "
            "keeps more)"
        )
    elif from_now:
        why = f"is recorded from row {source.begin} (--from-now)"
    else:
        why = (
            f"is recorded from row {source.begin}, because earlier ones were overwritten (a longer "
            f"--history keeps more)"
        )
    if alone:
        return f"{why}: a replay without its driver begins at the first row in which nothing acts"
    return (
        f"{why}: a replay begins at the next reset, restored snapshot or snapshot at rest "
        f"(--snapshots), or, with --without-driver, at the first row in which nothing acts"
    )


class _Report:
    """Prints the progress of a recording on stderr: one line, rewritten on a terminal."""

    def __init__(self, recorder: "Recorder", from_now: bool) -> None:
        self._recorder = recorder
        self._from_now = from_now
        self._at = time.monotonic()
        self._rows = 0
        self._missed = 0
        self._absent: set[str] = set()
        self._reported: dict[str, int] = {}  # for each segment the run that was reported
        self._terminal = sys.stderr.isatty()

    def show(self, last: bool = False) -> None:
        self._say_what_begins()
        now = time.monotonic()
        if now - self._at < _BETWEEN_REPORTS and not last:
            return
        recorder = self._recorder
        self._say_what_changed(last)
        rate = (recorder.rows - self._rows) / (now - self._at)
        self._at, self._rows = now, recorder.rows
        if last or self._terminal:
            behind = sum(source.behind for source in recorder.sources.values())
            line = f"{recorder.rows} rows"
            if not last:
                line += f", {rate:.0f} a second, {behind} behind"
            line += f", {recorder.missed} missed" if recorder.missed else ""
            line += f", {bytes_text(recorder.size)} in {recorder.path}"
            overwrite(line, end="\n" if last else "")

    def _say_what_begins(self) -> None:
        for name, source in self._recorder.sources.items():
            run = source.position[0]
            if source.frontend is not None and self._reported.get(name) != run:
                self._reported[name] = run
                complain(f"'{name}' {_replay_text(source, source.frontend, self._from_now)}")

    def _say_what_changed(self, last: bool) -> None:
        recorder = self._recorder
        if recorder.missed > self._missed:
            complain(
                f"{recorder.missed - self._missed} rows were overwritten before they were read: "
                f"the file has a gap. A longer --history of the robot gives the recorder more time"
            )
            self._missed = recorder.missed
        if last:  # sources are closed
            for name, source in recorder.sources.items():
                if not source.rows:
                    complain(
                        f"nothing of '{name}' was recorded: no robot of that name published a row"
                    )
            return
        absent = {name for name, source in recorder.sources.items() if source.frontend is None}
        for name in sorted(absent - self._absent):
            complain(f"waiting for segment '{name}'")
        self._absent = absent
