"""Reactions of the others when one process of the lab is killed: the table of page and test."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

import o80
from o80_devices.ball_tracking.ball_row import Reason as TrackerReason
from o80_devices.motion_capture.sensor import Reason as CaptureReason
from o80_table_tennis.lab.parts import (
    ARM,
    CAMERAS,
    ENVIRONMENT,
    LAUNCHER,
    MOTION_CAPTURE,
    NINE,
    RECORDER,
    TRACKER,
    VIEW,
    WORLD,
)

SUPERVISOR = "supervisor"
Bools = NDArray[np.bool_]


@dataclass(frozen=True)
class Mark:
    """How a part says that another one is missing."""

    part: str
    says: str
    """For people."""
    holds: Callable[[o80.History], Bools] | None = None
    """Selects the rows that say so; None: an entry of its journal, or of the supervisor, does."""
    journal: str = ""
    """Kind of that entry."""


@dataclass(frozen=True)
class Kill:
    """One line of the table."""

    killed: str
    marks: tuple[Mark, ...]
    halts: tuple[str, ...] = ()
    """Processes that stand still until it is back."""
    remark: str = ""
    """For people: what else happens."""

    @property
    def goes_on(self) -> tuple[str, ...]:
        """All others."""
        return tuple(name for name in NINE if name not in (self.killed, *self.halts))


def _missing(part: str) -> Mark:
    """Every row of the environment tells what is missing."""

    def holds(rows: o80.History) -> Bools:
        return np.asarray(rows.extended.missing[part], np.bool_)

    return Mark(ENVIRONMENT, f"`missing.{part}`", holds)


def _no_image(rows: o80.History) -> Bools:
    return np.asarray(rows.extended.reason == TrackerReason.no_image)


def _no_racket(rows: o80.History) -> Bools:
    seen: Any = rows.extended
    return np.asarray((seen.reason == CaptureReason.SEEN) & ~seen.racket.visible)


SUPERVISED = Mark(SUPERVISOR, "names it, with its last lines")
BLIND = Mark(TRACKER, "`reason` is `no_image`", _no_image)
"""The cameras mark images of a world that stands still, or is gone, by a capture time of 0."""
KILLS = {
    kill.killed: kill
    for kill in (
        Kill(
            ARM,
            (
                _missing(ARM),
                Mark(MOTION_CAPTURE, "`racket.visible` is false", _no_racket),
                BLIND,
                SUPERVISED,
            ),
            halts=(WORLD,),
            remark="the ball is given up; the next one is played when the arm is back",
        ),
        Kill(
            WORLD,
            (_missing(WORLD), BLIND, SUPERVISED),
            remark="the ball is given up; the arm keeps its pressures",
        ),
        Kill(
            LAUNCHER,
            (_missing(LAUNCHER), SUPERVISED),
            remark="a ball in flight is played to its end; no other one starts",
        ),
        Kill(
            CAMERAS,
            (
                BLIND,
                _missing(CAMERAS),
                SUPERVISED,
            ),
        ),
        Kill(
            TRACKER,
            (_missing(TRACKER), SUPERVISED),
            remark="a ball in flight is played on as the filter of the observation predicts it",
        ),
        Kill(MOTION_CAPTURE, (_missing(MOTION_CAPTURE), SUPERVISED)),
        Kill(
            ENVIRONMENT,
            (Mark(ARM, "journal: `died`", journal="died"), BLIND, SUPERVISED),
            halts=(WORLD,),
            remark="the arm purges what was asked of it, and keeps its pressures",
        ),
        Kill(
            RECORDER,
            (SUPERVISED,),
            remark="started again, it goes on in the same file, without a gap",
        ),
        Kill(VIEW, (SUPERVISED,), remark="started again, it has another address"),
    )
}
"""By the process that is killed."""


def as_markdown() -> str:
    """The table, for a page."""
    lines = [
        "| killed | who says so, and how | who stands still | who goes on | besides |",
        "|---|---|---|---|---|",
    ]
    for kill in KILLS.values():
        marks = "; ".join(f"{mark.part}: {mark.says}" for mark in kill.marks)
        others = len(NINE) - 1 - len(kill.halts)
        on = "all others" if others == len(NINE) - 1 else f"the other {others}"
        halts = ", ".join(kill.halts)
        lines.append(f"| {kill.killed} | {marks} | {halts} | {on} | {kill.remark} |")
    return "\n".join(lines) + "\n"
