"""Summary of an episode, made by the environment."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..task.ball_record import BallRecord
from ..task.outcome import returned


@dataclass(frozen=True)
class EpisodeSummary:
    """Result of an episode."""

    number: int
    """Number of the episode in its environment, from 0."""
    ball: int
    """Number of the ball in its source; -1 for one given by the user."""
    steps: int
    reward: float
    """Sum of rewards over the episode."""
    touched: bool
    """Whether the racket has touched the ball."""
    returned: bool
    """Whether the ball was returned to the opponent's half, see `task.outcome`."""
    landing: list[float] | None
    """First contact with the table after the touch, on either half [m]; None: none."""
    speed: float
    """Largest speed of the ball after the touch [m/s]; 0 without a touch."""
    terminated: bool
    """Whether the task ended the episode; else truncated by the number of steps, or stalled."""
    end: str
    """Reason of the end."""
    arm_first: int
    """Iteration of the arm before the first step."""
    arm_last: int
    twin_first: int
    """Iteration of the twin before the first step."""
    twin_last: int

    @classmethod
    def of(cls, record: BallRecord, **others: Any) -> EpisodeSummary:
        """Makes a summary from the record of a ball; `others` are copied."""
        return cls(
            touched=bool(record.touched),
            returned=bool(returned(record)),
            landing=np.asarray(record.landing).tolist() if record.landed else None,
            speed=float(record.largest_speed),
            **others,
        )
