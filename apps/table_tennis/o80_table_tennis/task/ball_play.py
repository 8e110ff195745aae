"""The named tasks: return the ball to the target, or smash it there.

They share the observation of 22 numbers and the end of an episode, and differ in the reward, which
is paid in the last step. An episode that is truncated is paid nothing: its value is for the learner
to estimate. The goal of an episode is the target on the table.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from o80.base.arrays import Float32Array, FloatArray

from .end import EndRule, terminated
from .observations import ObservationBounds, observe_ball
from .outcome import outcome
from .rewards import OrderedReward, RewardRule
from .state import State


@dataclass(frozen=True)
class ReturnTask:
    """The ball should land on the target.

    A task of your own is an object with the same members (`MEMBERS`), derived from this class or
    not, for `TaskSettings(task=...)`. The environment moves arm and ball; the task defines
    observation, reward and end. Each method takes the `State` of N episodes, and returns as many
    results: a single environment has one episode, a vector environment many.
    """

    bounds: ObservationBounds = field(default_factory=ObservationBounds)
    rule: EndRule = field(default_factory=EndRule)
    pay: RewardRule = field(default_factory=OrderedReward)

    @property
    def low(self) -> Float32Array:
        """(22,)"""
        return self.bounds.low

    @property
    def high(self) -> Float32Array:
        """(22,)"""
        return self.bounds.high

    def begin(self, rng: np.random.Generator) -> FloatArray:
        """Goal (G,) of a new episode: the target (3,) on the table [m], always the same one.

        A task that draws its goal draws from `rng` only.
        """
        return np.array(self.pay.target)

    def observe(self, state: State) -> FloatArray:
        """(..., 22) fresh, see `observations`; the environment clips them into the bounds."""
        return observe_ball(state)

    def eventful(self, state: State) -> Any:
        """(...) whether the episode has ended; of other tasks also whether the step is paid.

        Cheap: it is called after every step, `end` and `reward` only where it is true.
        """
        return self.rule.ended(state.record, state.ball[..., 1], state.steps)

    def end(self, state: State) -> NDArray[np.int64]:
        """(...) numbers of `End`: RUNNING, or why the episode has ended."""
        return self.rule.judge(state.record, state.ball[..., 1], state.steps)

    def reward(self, state: State) -> FloatArray:
        """(...) reward of an episode that ends in this state; 0 if it is truncated or goes on."""
        return np.where(terminated(self.end(state)), self.worth(state), 0.0)

    def worth(self, state: State) -> FloatArray:
        """(...) of an episode that an event ends in this state."""
        return self.pay.returned(state)

    def info(self, state: State) -> dict[str, Any]:
        """`touched`, `returned`, `landing` and `distance`: see `outcome`; `speed`, the largest one
        of the ball since the touch [m/s] (0 before); `smallest_distance` of the surfaces of ball
        and racket so far [m].
        """
        info = outcome(state.record, state.goal)
        info["speed"] = state.record.largest_speed
        info["smallest_distance"] = state.record.smallest_distance
        return info


MEMBERS = ("low", "high", "begin", "observe", "eventful", "end", "reward", "info")


def missing_members(task: object) -> list[str]:
    """Members that an object lacks to be a task."""
    return [name for name in MEMBERS if not hasattr(task, name)]


def observes_as_published(task: object) -> bool:
    """Whether a task observes the 22 numbers, and nothing of its own."""
    return getattr(type(task), "observe", None) is ReturnTask.observe


@dataclass(frozen=True)
class SmashTask(ReturnTask):
    """The ball should land on the target, and be fast."""

    def worth(self, state: State) -> FloatArray:
        """(...) of an episode that an event ends in this state."""
        return self.pay.smashed(state)
