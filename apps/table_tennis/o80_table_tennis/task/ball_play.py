"""The tasks with a ball: hit it, return it to the target, smash it.

They share the observation of 22 numbers and the end of an episode, and differ in the reward, which
is paid in the last step. The goal of an episode is the target on the table.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .end import End, EndRule
from .observations import ObservationBounds, observe_ball
from .rewards import RewardRule
from .state import State

Float32Array = NDArray[np.float32]
FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class ReturnTask:
    """The ball should land on the target: the published table-tennis reward."""

    bounds: ObservationBounds = field(default_factory=ObservationBounds)
    rule: EndRule = field(default_factory=EndRule)
    pay: RewardRule = field(default_factory=RewardRule)

    plays_ball = True

    @property
    def low(self) -> Float32Array:
        """(22,)"""
        return self.bounds.low

    @property
    def high(self) -> Float32Array:
        """(22,)"""
        return self.bounds.high

    def begin(self, rng: np.random.Generator) -> FloatArray:
        """The target (3,) on the table [m]; always the same one."""
        return np.array(self.pay.target)

    def observe(self, state: State) -> FloatArray:
        """(..., 22) see `observations`."""
        return observe_ball(state)

    def eventful(self, state: State) -> Any:
        """(...) whether the episode has ended."""
        return self.rule.ended(state.record, state.ball_y, state.steps)

    def end(self, state: State) -> NDArray[np.int64]:
        """(...) why it has."""
        return self.rule.judge(state.record, state.ball_y, state.steps)

    def reward(self, state: State) -> FloatArray:
        """(...) reward of an episode that ends in this state."""
        return self.pay.returned(state.record, state.goal)

    def info(self, state: State) -> dict[str, Any]:
        """`hit`: the racket has touched the ball; `smallest_distance` of their surfaces [m]."""
        return {"hit": state.record.touched, "smallest_distance": state.record.smallest_distance}


@dataclass(frozen=True)
class SmashTask(ReturnTask):
    """The ball should land on the target, and be fast: published as well."""

    def reward(self, state: State) -> FloatArray:
        """(...) reward of an episode that ends in this state."""
        return self.pay.smashed(state.record, state.goal)


@dataclass(frozen=True)
class HitTask(ReturnTask):
    """The racket should touch the ball, wherever it flies then; a touch ends the episode."""

    def eventful(self, state: State) -> Any:
        """(...) whether the episode has ended."""
        return state.record.touched | super().eventful(state)

    def end(self, state: State) -> NDArray[np.int64]:
        """(...) why it has."""
        return np.where(state.record.touched, int(End.GOAL), super().end(state))

    def reward(self, state: State) -> FloatArray:
        """(...) 1 for a touch, else minus the smallest distance [m]."""
        return self.pay.touched(state.record)
