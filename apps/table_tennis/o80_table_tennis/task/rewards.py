"""Rewards of the named tasks, paid when an episode has ended by an event.

`ORDERED` rates any miss below any touch, and any touch below any return. `PUBLISHED` is the
rule of the published configuration. It ignores the half of the landing, so that a policy may
learn to drop the ball on its own half, and rates a touch that does not reach the table below a
near miss.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from o80.base.arrays import FloatArray

from ..world.scene import Vector
from ..world.table import TARGET
from .ball_record import Numbers
from .outcome import distance, ended_at, returned
from .state import State

# math and NumPy differ in the last bit: one episode and many must have the same rewards
_power = np.frompyfunc(math.pow, 2, 1)


def falling(distance: Numbers, reach: float, exponent: float) -> FloatArray:
    """Computes 1 - (distance / reach)^exponent for distances (...)."""
    share = np.asarray(_power(np.asarray(distance) / reach, exponent), np.float64)
    result: FloatArray = 1.0 - share
    return result


@dataclass(frozen=True)
class OrderedReward:
    """Miss: -min(smallest distance, 1.5), at most 0. Touch: 0 to 0.5, larger for a flight that ends
    nearer to the target. Return: 1 plus the accuracy of the landing, from 0 to 1.
    """

    target: Vector = TARGET
    """Target of the ball [m]."""
    farthest_miss: float = 1.5
    """Distance above which all misses have the same reward [m]."""
    touch: float = 0.5
    """Limit of a touch without a return, for a flight that ends at the target."""
    touch_scale: float = 1.5
    """Distance from the target at which a touch has half of that reward [m]."""
    reach: float = 3.0
    """Distance of a landing with accuracy 0 [m]: accuracy is 1 - (d / 3)^0.75."""
    exponent: float = 0.75

    def returned(self, state: State) -> FloatArray:
        """Rewards (...), see the class."""
        return self._paid(state, 1.0)

    def smashed(self, state: State) -> FloatArray:
        """Rewards (...) with accuracy times the largest speed after the touch [m/s]."""
        return self._paid(state, state.record.largest_speed)

    def _paid(self, state: State, factor: Numbers) -> FloatArray:
        record = state.record
        missed: FloatArray = -np.minimum(record.smallest_distance, self.farthest_miss)
        if not np.count_nonzero(record.touched):
            return missed
        apart = distance(ended_at(state), state.goal)
        accuracy = np.maximum(falling(apart, self.reach, self.exponent), 0.0) * factor
        relative = apart / self.touch_scale
        touch = self.touch / (1.0 + relative * relative)
        paid = np.where(returned(record), 1.0 + accuracy, touch)
        return np.where(record.touched, paid, missed)


@dataclass(frozen=True)
class PublishedReward:
    """Miss: minus the smallest distance. Touch: max(1 - (d / 3)^0.75, -0.2), with the distance d of
    the first landing, on either half, from the target; -0.2 without a landing.

    In the published system, d is the smallest distance of the whole flight after the touch, and no
    table stops the ball; here, the episode ends at the table.
    """

    target: Vector = TARGET
    """Target of the ball [m]."""
    reach: float = 3.0
    """Distance of a landing with reward 0 [m]."""
    exponent: float = 0.75
    floor: float = -0.2
    """Least reward of a touched ball."""

    def returned(self, state: State) -> FloatArray:
        """Rewards (...), see the class."""
        return self._paid(state, 1.0)

    def smashed(self, state: State) -> FloatArray:
        """Rewards (...) times the largest speed of the ball after the touch [m/s]."""
        return self._paid(state, state.record.largest_speed)

    def _paid(self, state: State, factor: Numbers) -> FloatArray:
        record = state.record
        apart = distance(record.landing, state.goal)
        landing = np.maximum(falling(apart, self.reach, self.exponent), self.floor) * factor
        touched = np.where(record.landed, np.maximum(landing, self.floor), self.floor)
        return np.where(record.touched, touched, -np.asarray(record.smallest_distance))


RewardRule = OrderedReward | PublishedReward
"""Reward rule, or any object with `target`, `returned` and `smashed`."""
REWARDS: Mapping[str, RewardRule] = {"ordered": OrderedReward(), "published": PublishedReward()}
"""Named rules."""


def reward_rule(reward: str | RewardRule) -> RewardRule:
    """Returns a rule by name, or the given one. Raises ValueError or TypeError for others."""
    if isinstance(reward, str):
        if reward not in REWARDS:
            raise ValueError(f"unknown reward '{reward}'; there are: {', '.join(REWARDS)}")
        return REWARDS[reward]
    missing = [name for name in ("target", "returned", "smashed") if not hasattr(reward, name)]
    if missing or isinstance(reward, type):
        raise TypeError(
            f"reward must be one of {', '.join(REWARDS)}, or an object like "
            f"o80_table_tennis.task.rewards.OrderedReward(), got {reward!r}"
        )
    return reward
