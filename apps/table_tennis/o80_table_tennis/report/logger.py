"""The logger: a process of its own that watches arm and twin, and writes a file an episode.

It only reads. The environment tells it, line by line, which rows belong to an episode; the rows
themselves it takes from the histories of both segments.
"""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from collections.abc import Iterable
from contextlib import AbstractContextManager, suppress
from dataclasses import asdict
from pathlib import Path
from types import TracebackType

import o80

from .episode_record import EpisodeRecord, EpisodeSummary

LONGEST_WRITING = 20.0
"""Timeout for writing the remaining episodes when it is closed [s]."""


class EpisodeLogger(AbstractContextManager["EpisodeLogger"]):
    """Starts the logger of the segments `arm` and `twin`; it ends with its parent process."""

    def __init__(self, folder: Path, *, arm: str, twin: str) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self._process = subprocess.Popen(
            [sys.executable, "-m", "o80_table_tennis.report.logger", arm, twin, str(folder)],
            stdin=subprocess.PIPE,
            text=True,
        )

    def add(self, summary: EpisodeSummary) -> None:
        """Asks for the record of an episode that has ended. No effect if the logger has died."""
        assert self._process.stdin is not None
        try:
            self._process.stdin.write(json.dumps(asdict(summary)) + "\n")
            self._process.stdin.flush()
        except (BrokenPipeError, ValueError):
            return

    def close(self) -> None:
        """Waits until all episodes are written; may be called twice."""
        assert self._process.stdin is not None
        with suppress(BrokenPipeError):
            self._process.stdin.close()
        try:
            self._process.wait(LONGEST_WRITING)
        except BaseException:
            self._process.kill()
            self._process.wait()
            raise

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()


def record_of(summary: EpisodeSummary, arm: o80.Frontend, twin: o80.Frontend) -> EpisodeRecord:
    """The rows of an episode, the one before its first step included.

    Raises RowOverwritten if the histories have gone on so far that some are no longer there.
    """
    arm_rows = rows_of(arm, summary.arm_first, summary.arm_last)
    twin_rows = rows_of(twin, summary.twin_first, summary.twin_last)
    return EpisodeRecord(
        summary=summary,
        period=arm.period,
        arm_iterations=arm_rows.iteration,
        arm_times=arm_rows.time,
        arm_lateness=arm_rows.lateness,
        pressures_asked=arm_rows.desired,
        pressures=arm_rows.observed,
        joint_positions=arm_rows.extended.joint_positions,
        joint_velocities=arm_rows.extended.joint_velocities,
        racket_positions=arm_rows.extended.racket_position,
        twin_iterations=twin_rows.iteration,
        twin_joint_positions=twin_rows.observed.joints["position"],
        twin_joint_velocities=twin_rows.observed.joints["velocity"],
        balls=twin_rows.observed.balls["position"],
        ball_velocities=twin_rows.observed.balls["velocity"],
    )


def rows_of(frontend: o80.Frontend, first: int, last: int) -> o80.History:
    """All rows from `first` to `last`."""
    rows = frontend.history(since=first, until=last)
    if len(rows) != last - first + 1:
        raise o80.RowOverwritten(
            f"rows {first} to {last} of '{frontend.segment}' are no longer all there: "
            "give arm and twins a longer history"
        )
    return rows


def write_episodes(
    lines: Iterable[str], folder: Path, arm: o80.Frontend, twin: o80.Frontend
) -> int:
    """Writes a file for each line; returns how many episodes could no longer be read."""
    lost = 0
    for line in lines:
        summary = EpisodeSummary(**json.loads(line))
        try:
            record = record_of(summary, arm, twin)
        except o80.RowOverwritten as error:
            lost += 1
            print(f"episode {summary.episode} is not recorded: {error}", file=sys.stderr)
            continue
        record.save(folder / f"episode_{summary.episode:05d}.npz")
    return lost


def main(arm: str, twin: str, folder: str) -> int:
    """Runs until its input ends."""
    # a Ctrl-C at the terminal arrives here too; the parent process ends the logger
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    with (
        o80.Frontend(arm, read_only=True) as arm_rows,
        o80.Frontend(twin, read_only=True) as twin_rows,
    ):
        lost = write_episodes(sys.stdin, Path(folder), arm_rows, twin_rows)
    return 1 if lost else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
