"""Named tasks: return the ball to the target, or smash it there.

Both have the observation of 22 numbers and the same end of an episode, but different rewards,
which are paid in the last step. A truncated episode has no reward: the learner estimates its
value. The goal of an episode is the target on the table.
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
    """Task: the ball should land on the target.

    Your own task is an object with the same members (`MEMBERS`), derived from this class or
    not, for `TaskSettings(task=...)`. The environment moves arm and ball; the task defines
    observation, reward and end. Each method takes the `State` of N episodes and returns N
    results: a single environment has one episode, a vector environment many.
    """

    bounds: ObservationBounds = field(default_factory=ObservationBounds)
    rule: EndRule = field(default_factory=EndRule)
    pay: RewardRule = field(default_factory=OrderedReward)

    @property
    def low(self) -> Float32Array:
        """Least observation (22,)."""
        return self.bounds.low

    @property
    def high(self) -> Float32Array:
        """Largest observation (22,)."""
        return self.bounds.high

    def begin(self, rng: np.random.Generator) -> FloatArray:
        """Returns the goal (G,) of a new episode: the fixed target (3,) on the table [m].

        A task with random goals draws from `rng` only.
        """
        return np.array(self.pay.target)

    def observe(self, state: State) -> FloatArray:
        """Returns observations (..., 22), fresh, see `observations`; the caller clamps them."""
        return observe_ball(state)

    def eventful(self, state: State) -> Any:
        """Flags (...) of ended episodes; for other tasks also of steps with a reward.

        Cheap, because called after every step; `end` and `reward` are called for flagged episodes.
        """
        return self.rule.ended(state.record, state.ball[..., 1], state.steps)

    def end(self, state: State) -> NDArray[np.int64]:
        """Returns numbers (...) of `End`: RUNNING, or the reason of the end."""
        return self.rule.judge(state.record, state.ball[..., 1], state.steps)

    def reward(self, state: State) -> FloatArray:
        """Returns rewards (...) of this state; 0 for truncated and running episodes."""
        return np.where(terminated(self.end(state)), self.worth(state), 0.0)

    def worth(self, state: State) -> FloatArray:
        """Returns rewards (...) of episodes that an event ends in this state."""
        return self.pay.returned(state)

    def info(self, state: State) -> dict[str, Any]:
        """Returns `touched`, `returned`, `landing`, `distance`, see `outcome`; `speed`, the ball's
        largest speed since the touch [m/s] (0 before); `smallest_distance` between the surfaces of
        ball and racket so far [m].
        """
        info = outcome(state.record, state.goal)
        info["speed"] = state.record.largest_speed
        info["smallest_distance"] = state.record.smallest_distance
        return info


MEMBERS = ("low", "high", "begin", "observe", "eventful", "end", "reward", "info")


def missing_members(task: object) -> list[str]:
    """Lists the members of a task that an object lacks."""
    return [name for name in MEMBERS if not hasattr(task, name)]


def observes_as_published(task: object) -> bool:
    """Whether a task observes the 22 published numbers."""
    return getattr(type(task), "observe", None) is ReturnTask.observe


@dataclass(frozen=True)
class SmashTask(ReturnTask):
    """Task: the ball should land on the target, and be fast."""

    def worth(self, state: State) -> FloatArray:
        """Returns rewards (...) of episodes that an event ends in this state."""
        return self.pay.smashed(state)
