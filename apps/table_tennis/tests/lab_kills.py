"""Kills each process of a running lab, and checks the others' reactions by the table of parts."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable
from contextlib import ExitStack
from typing import Any

import numpy as np
from numpy.typing import NDArray

import o80
from o80_devices.ball_tracking.ball_row import Reason as TrackerReason
from o80_devices.motion_capture.sensor import Reason as CaptureReason
from o80_table_tennis.lab.parts import (
    COUNTERPARTS,
    DIED,
    ENVIRONMENT,
    NO_IMAGE,
    NO_RACKET,
    RATES,
    RECORDER,
    WORLD,
    LabSettings,
    Part,
    lab_parts,
)
from o80_table_tennis.lab.processes import Processes

SUPERVISOR = "supervisor"
WITHIN = 60.0
"""Timeout of reactions that take a fraction of a second on a quiet machine [s]."""
SAYS_WITHIN = 0.2
"""Longest time from the killed process's last row to the first report of its absence [s]."""
ROWS_ON = 20
"""Number of rows that every surviving process must still publish."""
Rows = Callable[[o80.History], NDArray[np.bool_]]


def _missing(part: str) -> Rows:
    return lambda rows: np.asarray(rows.extended.missing[part], np.bool_)


def _no_racket(rows: o80.History) -> NDArray[np.bool_]:
    seen: Any = rows.extended
    return np.asarray((seen.reason == CaptureReason.SEEN) & ~seen.racket.visible)


# the cameras mark images of a stopped or ended world by a capture time of 0
SAID: dict[str, Rows] = {
    NO_IMAGE: lambda rows: np.asarray(rows.extended.reason == TrackerReason.no_image),
    NO_RACKET: _no_racket,
    **{f"`missing.{part}`": _missing(part) for part in RATES | {WORLD: 0.0}},
}
"""Selects the rows that report an absence, by the texts of the table."""


class Killer:
    """Kills processes of a lab, one after the other."""

    def __init__(self, lab: Processes, settings: LabSettings) -> None:
        self._lab, self._recording = lab, settings.recording
        self._segments = {
            name: part.segment
            for name, part in lab.parts.items()
            if part.segment is not None and name != COUNTERPARTS
        }

    def kill(self, name: str) -> list[str]:
        """Kills a process, checks the others, restarts it and waits until no part misses it.

        Returns the parts that reported its absence too late. Raises AssertionError.
        """
        lab, part = self._lab, self._lab.parts[name]
        wait_until(lambda: self._nobody_misses(part), f"{name} is there before it is killed")
        with ExitStack() as stack:
            seen = {each: stack.enter_context(self._observer(each)) for each in self._segments}
            before = time.monotonic_ns()
            os.kill(lab.running[name].pid, signal.SIGKILL)
            assert name in lab.ended(WITHIN)
            ended, ended_at = lab.collected(name), time.monotonic_ns()
            assert ended.code == -9, f"{name} ended before it was killed: {ended}"
            has_rows = name in seen and not seen[name].bursting
            last = int(seen[name].latest().time) if has_rows else before
            late = [
                by
                for by, says in part.missed.items()
                # counted in the part's own rows, which are fewer on a slow machine
                if rows_until_said(by, says, seen[by], last, ended_at)
                > SAYS_WITHIN * RATES.get(by, np.inf)
            ]
            self._check_others(part, seen)
        size = self._recording.stat().st_size
        lab.start(name)
        lab.wait_until_running(WITHIN)
        if name == RECORDER:  # an earlier end of the lab would end the process, too
            wait_until(lambda: self._recording.stat().st_size > size, "the recorder goes on")
        wait_until(lambda: self._nobody_misses(part), f"{name} is missed no more")
        return late

    def _check_others(self, part: Part, seen: dict[str, o80.Frontend]) -> None:
        """Checks that continuing parts publish rows, and stopped ones none."""
        still = {name: seen[name].published for name in part.halts}
        on = [name for name in self._lab.running if name not in (COUNTERPARTS, *part.halts)]
        assert len(on) == 8 - len(still)
        for name in on:
            assert self._lab.runs(name), f"{name} has ended with {part.name}"
            if name in seen and (not seen[name].bursting or ENVIRONMENT in on):
                rows, enough = seen[name], seen[name].published + ROWS_ON
                wait_until(lambda: rows.published >= enough, f"{name} goes on")  # noqa: B023
        for name, published in still.items():
            assert seen[name].published == published, f"{name} goes on without {part.name}"

    def _observer(self, name: str) -> o80.Frontend:
        return o80.Frontend(self._segments[name], timeout=WITHIN, read_only=True)

    def _nobody_misses(self, part: Part) -> bool:
        """Whether no newest row reports the absence of a part."""
        for by, says in part.missed.items():
            if says in SAID:
                with self._observer(by) as observer:
                    if bool(SAID[says](observer.history(1))[0]):
                        return False
        return all(self._lab.runs(name) for name in (part.name, ENVIRONMENT))

    def wait_for_a_ball(self) -> None:
        """Waits until the environment has played another ball, from launch to end."""
        with self._observer(ENVIRONMENT) as environment:
            played = environment.latest().extended.balls_played
            wait_until(
                lambda: bool(environment.latest().extended.balls_played > played),
                "a ball is played",
            )


def rows_until_said(by: str, says: str, observer: o80.Frontend, last: int, ended_at: int) -> int:
    """Rows of a part from the end [ns] on until one, or an entry, after `last` [ns] says so."""
    found: list[int] = []

    def is_said() -> bool:
        found[:] = _first(says, observer, last)
        return bool(found)

    wait_until(is_said, f"{by} says: {says}")
    begin = min(max(last, ended_at), found[0])
    return len(observer.history().select(from_time=begin, to_time=found[0]))


def _first(says: str, observer: o80.Frontend, last: int) -> list[int]:
    """Its time [ns]; empty: none yet."""
    rows = observer.history()
    if says != DIED:
        saying = SAID[says](rows) & (rows.time > last)
        return [int(rows.time[saying.argmax()])] if saying.any() else []
    times = [
        int(rows.at_iteration(entry.iteration).time)
        for entry in observer.journal()
        if entry.kind == "died" and entry.iteration in rows.iteration
    ]
    return [when for when in times if when > last][:1]


def wait_until(holds: Callable[[], bool], what: str) -> None:
    """Polls until `holds` is true. Raises AssertionError after a long time."""
    end = time.monotonic() + WITHIN
    while not holds():
        assert time.monotonic() < end, f"after {WITHIN:g} s this has not happened: {what}"
        time.sleep(0.005)


def started(settings: LabSettings) -> Processes:
    """Starts a lab. Raises PartEndedError or o80.TimeoutError if a part does not run."""
    settings.recording.unlink(missing_ok=True)
    processes = Processes(lab_parts(settings).values(), settings.folder / "processes")
    try:
        processes.start()
        processes.wait_until_running(WITHIN)
    except BaseException:
        processes.close()
        raise
    return processes
