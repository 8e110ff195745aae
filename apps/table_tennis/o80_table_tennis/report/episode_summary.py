"""How an episode ended, as the environment tells it."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class EpisodeSummary:
    """How an episode ended."""

    number: int
    """Of the episode in its environment, from 0."""
    ball: int
    """Number of the ball in its source; -1 for one given by the user."""
    steps: int
    reward: float
    """Sum over the episode."""
    hit: bool
    """The racket has touched the ball."""
    returned: bool
    """It has, and the ball flew back: v_y > 0 after the touch."""
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
