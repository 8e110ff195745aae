"""When an episode of ball play ends, and why."""

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
    """Why an episode ended. Arrays hold these numbers."""

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
    """The ball landed first on the player's own half after the touch."""
    TABLE_SIDE = 8
    """The ball met a side of the table after the touch, not its top."""
    STALLED = 9
    """Real time: the caller paused for so long that the episode was given up."""
    HALTED = 10
    """The arm or a twin was halted: why is in `info["halt"]`."""

    def __init__(self, number: int) -> None:
        self.text = self.name.lower().replace("_", " ")
        """As in `info["end_text"]`: "out of steps"."""

    @property
    def terminated(self) -> bool:
        """Ended by an event."""
        return self is not End.RUNNING and not self.truncated

    @property
    def truncated(self) -> bool:
        """Ended by the number of steps, or stalled."""
        return self in (End.OUT_OF_STEPS, End.STALLED)


BY_EVENT = np.array([end.terminated for end in End])
"""Whether an event ended the episode, for each end by its number."""
# plain numbers: NumPy takes ten times as long to read a member of an IntEnum
_RUNNING, _RETURNED, _NET, _FLOOR, _PASSED, _OUT_OF_STEPS = map(int, list(End)[:6])
_OWN_HALF, _TABLE_SIDE = int(End.OWN_HALF), int(End.TABLE_SIDE)


def terminated(ends: Any) -> Any:
    """(...) whether numbers of `End` are ends by an event: only these are paid by a named task."""
    return BY_EVENT[np.asarray(ends)]


@dataclass(frozen=True)
class EndRule:
    """The limits of an episode."""

    passed_y: float = -0.8
    """A ball nearer to the wall behind the arm than this has passed it [m]."""
    max_steps: int = MAX_STEPS
    """Steps of the environment after which an episode is truncated."""

    def ended(self, record: BallRecord, y: Numbers, steps: int | IntArray) -> Any:
        """(...) whether any reason holds, for balls at `y` [m] after so many steps.

        Cheap: it is asked after every step. `judge` says which one.
        """
        return (
            record.landed
            | record.touched_net
            | record.touched_floor
            | (steps >= self.max_steps)
            | (y < self.passed_y)
        )

    def judge(self, record: BallRecord, y: Numbers, steps: int | IntArray) -> IntArray:
        """(...) the first reason that holds, as numbers of `End`."""
        # the first reasons last: they replace the others
        ends = np.where(steps >= self.max_steps, _OUT_OF_STEPS, _RUNNING)
        ends = np.where(y < self.passed_y, _PASSED, ends)
        ends = np.where(record.touched_floor, _FLOOR, ends)
        if np.count_nonzero(record.landed):
            on_half = np.where(beyond_net(record), _RETURNED, _OWN_HALF)
            ends = np.where(record.landed, np.where(on_top(record), on_half, _TABLE_SIDE), ends)
        return np.where(record.touched_net, _NET, ends)
