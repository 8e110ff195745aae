"""When an episode of ball play ends, and why."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .ball_record import BallRecord, Numbers

IntArray = NDArray[np.int64]


MOST_STEPS = 300


class End(IntEnum):
    """Why an episode ended. Arrays hold these numbers."""

    RUNNING = 0
    LANDED = 1
    NET = 2
    FLOOR = 3
    PASSED = 4
    """The ball has passed the arm."""
    OUT_OF_STEPS = 5
    GOAL = 6
    """The goal of the task is reached."""

    def __init__(self, number: int) -> None:
        self.text = self.name.lower().replace("_", " ")
        """As in `info["end"]`: "out of steps"."""

    @property
    def terminated(self) -> bool:
        """Ended by an event."""
        return self not in (End.RUNNING, End.OUT_OF_STEPS)

    @property
    def truncated(self) -> bool:
        """Ended by the number of steps."""
        return self is End.OUT_OF_STEPS


@dataclass(frozen=True)
class EndRule:
    """The limits of an episode."""

    passed_y: float = -0.8
    """A ball nearer to the wall behind the arm than this has passed it [m]."""
    most_steps: int = MOST_STEPS
    """Steps of the environment after which an episode is truncated."""

    def ended(self, record: BallRecord, y: Numbers, steps: int | IntArray) -> Any:
        """(...) whether any reason holds, for balls at `y` [m] after so many steps.

        Cheap: it is asked after every step. `judge` says which one.
        """
        return (
            record.landed
            | record.touched_net
            | record.touched_floor
            | (steps >= self.most_steps)
            | (y < self.passed_y)
        )

    def judge(self, record: BallRecord, y: Numbers, steps: int | IntArray) -> IntArray:
        """(...) the first reason that holds, as numbers of `End`."""
        reasons = [
            (record.landed, End.LANDED),
            (record.touched_net, End.NET),
            (record.touched_floor, End.FLOOR),
            (y < self.passed_y, End.PASSED),
            (steps >= self.most_steps, End.OUT_OF_STEPS),
        ]
        holds = np.broadcast_arrays(*(reason for reason, _ in reasons))
        return np.select(holds, [int(end) for _, end in reasons], int(End.RUNNING))
