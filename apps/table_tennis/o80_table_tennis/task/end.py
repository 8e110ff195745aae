"""Ends of episodes of ball play, and their reasons."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import Any

import numpy as np

from o80.base.arrays import IntArray

from .ball_record import BallRecord, Numbers
from .outcome import beyond_net, on_top

MAX_STEPS = 300


class End(IntEnum):
    """Reason of an episode's end; arrays hold its number."""

    RUNNING = 0
    RETURNED = 1
    """The ball landed on the opponent's half, see `outcome`."""
    NET = 2
    """The ball touched the net before it landed."""
    FLOOR = 3
    PASSED = 4
    """The ball has passed the arm."""
    OUT_OF_STEPS = 5
    GOAL = 6
    """The goal of the task is reached."""
    OWN_HALF = 7
    """The ball first landed on the player's own half after the touch."""
    TABLE_SIDE = 8
    """The ball hit a side of the table after the touch, not the top."""
    STALLED = 9
    """Real time: the caller was too late."""
    HALTED = 10
    """The arm or a twin was halted; `info["halt"]` has the reason."""

    def __init__(self, number: int) -> None:
        self.text = self.name.lower().replace("_", " ")
        """Text in `info["end_text"]`, such as "out of steps"."""

    @property
    def terminated(self) -> bool:
        """Whether an event ended the episode."""
        return self is not End.RUNNING and not self.truncated

    @property
    def truncated(self) -> bool:
        """Whether the number of steps ended the episode, or the caller stalled."""
        return self in (End.OUT_OF_STEPS, End.STALLED)


BY_EVENT = np.array([end.terminated for end in End])
"""Whether each end, by number, is by an event."""
# plain numbers: NumPy reads members of an IntEnum ten times as slowly
_RUNNING, _RETURNED, _NET, _FLOOR, _PASSED, _OUT_OF_STEPS = map(int, list(End)[:6])
_OWN_HALF, _TABLE_SIDE = int(End.OWN_HALF), int(End.TABLE_SIDE)


def terminated(ends: Any) -> Any:
    """Flags (...) of numbers of `End` that are ends by an event: only these have a reward."""
    return BY_EVENT[np.asarray(ends)]


@dataclass(frozen=True)
class EndRule:
    """Limits of an episode."""

    passed_y: float = -0.8
    """Largest y of a ball that has passed the arm [m]."""
    max_steps: int = MAX_STEPS
    """Number of steps after which an episode is truncated."""

    def ended(self, record: BallRecord, y: Numbers, steps: int | IntArray) -> Any:
        """Flags (...) of ended episodes, for balls at `y` [m] after `steps`.

        Cheap, because called after every step. `judge` finds the reason.
        """
        return (
            record.landed
            | record.touched_net
            | record.touched_floor
            | (steps >= self.max_steps)
            | (y < self.passed_y)
        )

    def judge(self, record: BallRecord, y: Numbers, steps: int | IntArray) -> IntArray:
        """Returns the first valid reason (...), as numbers of `End`."""
        # in reverse order, so that the first reasons replace the others
        ends = np.where(steps >= self.max_steps, _OUT_OF_STEPS, _RUNNING)
        ends = np.where(y < self.passed_y, _PASSED, ends)
        ends = np.where(record.touched_floor, _FLOOR, ends)
        if np.count_nonzero(record.landed):
            on_half = np.where(beyond_net(record), _RETURNED, _OWN_HALF)
            ends = np.where(record.landed, np.where(on_top(record), on_half, _TABLE_SIDE), ends)
        return np.where(record.touched_net, _NET, ends)
