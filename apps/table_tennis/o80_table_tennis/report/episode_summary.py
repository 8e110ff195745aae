"""How an episode ended, as the environment tells it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..task.ball_record import BallRecord
from ..task.outcome import returned


@dataclass(frozen=True)
class EpisodeSummary:
    """How an episode ended."""

    number: int
    """Number of the episode in its environment, from 0."""
    ball: int
    """Number of the ball in its source; -1 for one given by the user."""
    steps: int
    reward: float
    """Sum over the episode."""
    touched: bool
    """The racket has touched the ball."""
    returned: bool
    """The ball then landed on the opponent's half, see `task.outcome`."""
    landing: list[float] | None
    """Where it first touched the table after the touch, on whichever half [m]; None: nowhere."""
    speed: float
    """Largest speed of the ball after the touch [m/s]; 0 without one."""
    terminated: bool
    """Ended by the rule of the task; else truncated: by the number of steps, or as stalled."""
    end: str
    """Why the episode ended."""
    arm_first: int
    """Iteration of the arm before the first step."""
    arm_last: int
    twin_first: int
    """Iteration of the twin before the first step."""
    twin_last: int

    @classmethod
    def of(cls, record: BallRecord, **others: Any) -> EpisodeSummary:
        """Summary of what happened to the ball of one episode, and the `others` as they are."""
        return cls(
            touched=bool(record.touched),
            returned=bool(returned(record)),
            landing=np.asarray(record.landing).tolist() if record.landed else None,
            speed=float(record.largest_speed),
            **others,
        )
