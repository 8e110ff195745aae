"""Kills each process of a running lab, and looks what the others say: see the table of parts."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
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
"""For what takes a fraction of a second on a quiet machine [s]."""
SAYS_WITHIN = 0.2
"""From the last row of the killed process to the first one that says that it is missing [s]."""
ROWS_ON = 20
"""Rows that every surviving process must still publish."""
LOOK = 0.005
"""[s]"""


def _missing(part: str) -> Callable[[o80.History], NDArray[np.bool_]]:
    return lambda rows: np.asarray(rows.extended.missing[part], np.bool_)


def _no_racket(rows: o80.History) -> NDArray[np.bool_]:
    seen: Any = rows.extended
    return np.asarray((seen.reason == CaptureReason.SEEN) & ~seen.racket.visible)


# the cameras mark images of a world that stands still, or is gone, by a capture time of 0
SAID: dict[str, Callable[[o80.History], NDArray[np.bool_]]] = {
    NO_IMAGE: lambda rows: np.asarray(rows.extended.reason == TrackerReason.no_image),
    NO_RACKET: _no_racket,
    **{f"`missing.{part}`": _missing(part) for part in RATES | {WORLD: 0.0}},
}
"""Selects the rows that say so, by the words of the table."""


@dataclass
class Said:
    """How a part said that another one was missing."""

    part: str
    rows: int
    """Rows of that part from the end of the killed process on; a busy machine may need long."""

    @property
    def in_time(self) -> bool:
        """Within 200 ms by its own rows: on a machine that is too slow fewer of them come."""
        return self.rows <= SAYS_WITHIN * RATES.get(self.part, np.inf)


@dataclass
class Outcome:
    """Observations after a kill."""

    killed: str
    ended_at: int = 0
    """When the killed process had ended [ns]."""
    said: list[Said] = field(default_factory=list)
    stood_still: list[str] = field(default_factory=list)
    went_on: list[str] = field(default_factory=list)
    joined: bool = False
    """Started again, nobody misses it any more."""


class Killer:
    """Kills processes of a lab, one after the other."""

    def __init__(self, processes: Processes, recording: Path) -> None:
        self._processes, self._recording = processes, recording
        self._segments = {
            name: part.segment
            for name, part in processes.parts.items()
            if part.segment is not None and name != COUNTERPARTS
        }

    def kill(self, name: str) -> Outcome:
        """Kills a process, looks, starts it again and waits until it has joined.

        Raises AssertionError, with what did not happen.
        """
        kill, outcome = self._processes.parts[name], Outcome(name)
        wait_until(lambda: self._nobody_misses(kill), f"{name} is there before it is killed")
        observers = {
            part: o80.Frontend(segment, timeout=WITHIN, read_only=True)
            for part, segment in self._segments.items()
        }
        try:
            last = self._kill(name, observers, outcome)
            for part, says in (kill.missed or {}).items():
                outcome.said.append(said(part, says, observers[part], last, outcome.ended_at))
            self._look_at_others(kill, observers, outcome)
        finally:
            for each in observers.values():
                each.close()
        self._start_again(kill, outcome)
        return outcome

    def _kill(self, name: str, observers: dict[str, o80.Frontend], outcome: Outcome) -> int:
        """Time of the last row of the process, or of the kill if it has no rows by the clock."""
        before, processes = time.monotonic_ns(), self._processes
        os.kill(processes.running[name].pid, signal.SIGKILL)
        assert name in processes.ended(WITHIN)
        ended = processes.collected(name)
        outcome.ended_at = time.monotonic_ns()
        assert ended.code == -9, f"{name} ended before it was killed: {ended}"
        outcome.said.append(Said(SUPERVISOR, 0))
        observer = observers.get(name)
        if observer is None or observer.bursting:
            return before
        return int(observer.latest().time)

    def _look_at_others(
        self, kill: Part, observers: dict[str, o80.Frontend], outcome: Outcome
    ) -> None:
        """Rows of those that go on come; none of those that stand still."""
        still = {name: observers[name].published for name in kill.halts}
        on = [name for name in self._processes.running if name not in (COUNTERPARTS, *kill.halts)]
        for name in on:
            observer = observers.get(name)
            if observer is None:
                assert self._processes.runs(name), f"{name} has ended with {kill.name}"
            elif not observer.bursting or ENVIRONMENT in on:
                wait_for_rows(observer, name)
        for name, rows in still.items():
            assert observers[name].published == rows, f"{name} goes on without {kill.name}"
        outcome.went_on, outcome.stood_still = on, list(still)

    def _start_again(self, kill: Part, outcome: Outcome) -> None:
        name, recording = kill.name, self._recording
        size = recording.stat().st_size
        self._processes.start(name)
        self._processes.wait_until_running(WITHIN)
        if name == RECORDER:  # a lab that ends before would end it, too
            wait_until(lambda: recording.stat().st_size > size, "the recorder goes on")
        wait_until(lambda: self._nobody_misses(kill), f"{name} is missed no more")
        outcome.joined = True

    def _nobody_misses(self, kill: Part) -> bool:
        """The newest rows of those that would say so do not."""
        for part, says in (kill.missed or {}).items():
            if says not in SAID:
                continue
            with o80.Frontend(self._segments[part], timeout=WITHIN, read_only=True) as observer:
                if bool(SAID[says](observer.history(1))[0]):
                    return False
        return all(self._processes.runs(name) for name in (kill.name, ENVIRONMENT))

    def wait_for_a_ball(self) -> None:
        """Until the environment has played another ball, from its launch to its end."""
        segment = self._segments[ENVIRONMENT]
        with o80.Frontend(segment, timeout=WITHIN, read_only=True) as environment:
            played = environment.latest().extended.balls_played

            def another() -> bool:
                return bool(environment.latest().extended.balls_played > played)

            wait_until(another, "a ball is played")


def said(part: str, says: str, observer: o80.Frontend, last: int, ended_at: int) -> Said:
    """The first row, or entry, after the time `last` [ns] that says so, after the end [ns]."""
    found: list[int] = []

    def look() -> bool:
        found[:] = _first(says, observer, last)
        return bool(found)

    wait_until(look, f"{part} says: {says}")
    begin = min(max(last, ended_at), found[0])
    rows = observer.history().select(from_time=begin, to_time=found[0])
    return Said(part, len(rows))


def _first(says: str, observer: o80.Frontend, last: int) -> list[int]:
    """Its time [ns]; empty: none yet."""
    rows = observer.history()
    if says != DIED:
        saying = SAID[says](rows) & (rows.time > last)
        return [int(rows.time[saying.argmax()])] if saying.any() else []
    for entry in observer.journal():
        if entry.kind == "died" and entry.iteration in rows.iteration:
            when = int(rows.at_iteration(entry.iteration).time)
            if when > last:
                return [when]
    return []


def wait_for_rows(observer: o80.Frontend, name: str) -> None:
    """Waits until so many rows are published; a short history may have lost any one of them."""
    enough = observer.published + ROWS_ON
    wait_until(lambda: observer.published >= enough, f"{name} goes on")


def wait_until(holds: object, what: str) -> None:
    """Looks again and again. Raises AssertionError after a long time."""
    assert callable(holds)
    end = time.monotonic() + WITHIN
    while not holds():
        assert time.monotonic() < end, f"after {WITHIN:g} s this has not happened: {what}"
        time.sleep(LOOK)


def started(settings: LabSettings) -> Processes:
    """The running lab. Raises PartEndedError, o80.TimeoutError."""
    settings.recording.unlink(missing_ok=True)
    processes = Processes(lab_parts(settings).values(), settings.folder / "processes")
    try:
        processes.start()
        processes.wait_until_running(WITHIN)
    except BaseException:
        processes.close()
        raise
    return processes
