"""The balls beside the one that is played: each meets the same arm and is paid for on its own."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..balls.trajectories import SampledFlight
from ..settings import RigSettings, TaskSettings
from ..task.observations import JOINT_POSITIONS, PRESSURES, SIZE, Float32Array
from ..task.rewards import EndRule, RewardRule
from .ball_records import record_of, settled_balls, touched_balls
from .twin import Twin

FloatArray = NDArray[np.float64]

ARM = slice(JOINT_POSITIONS.start, PRESSURES.stop)
"""What all observations of a step have in common."""
BALL = slice(PRESSURES.stop, SIZE)


class VirtualBalls:
    """All extra balls, in the order of the twins that hold them."""

    def __init__(self, twins: Sequence[Twin], rig: RigSettings, task: TaskSettings) -> None:
        self._twins, self._rig = twins, rig
        self._end: EndRule = task.end
        self._reward: RewardRule = task.reward
        self._low, self._high = task.bounds.low, task.bounds.high
        # the first twin holds the ball that is played; a twin without extra balls mirrors it
        self._extra = [
            slice(twin.balls - rig.extra_balls_of(number), twin.balls)
            for number, twin in enumerate(twins)
        ]
        self.begin()

    def begin(self, numbers: Sequence[int] = ()) -> None:
        """A new episode with these balls."""
        self._numbers = np.array(numbers, dtype=np.int64)
        self._ended = np.zeros(self._rig.extra_balls, np.bool_)
        self._hits = np.zeros(self._rig.extra_balls, np.bool_)

    def share(self, flights: Sequence[SampledFlight]) -> list[list[SampledFlight]]:
        """The flights of each twin's balls, of all flights, the played one first."""
        played, left = flights[0], list(flights[1:])
        shared = []
        for number, twin in enumerate(self._twins):
            extra = self._rig.extra_balls_of(number)
            mine, left = left[:extra], left[extra:]
            shared.append([played] * (twin.balls - extra) + mine)
        return shared

    def look(self, observation: Float32Array, *, steps: int, over: bool) -> dict[str, Any]:
        """What the twins' newest rows say about the extra balls, beside the observation (22,).

        A ball is paid for once: when its own episode ends, or at last when the played ball's is
        `over`. After that, `ended` says that its entries mean nothing any more.
        """
        balls = [
            twin.all_balls(twin.row)[extra]
            for twin, extra in zip(self._twins, self._extra, strict=True)
        ]
        records = np.concatenate(
            [
                twin.records(twin.row)[extra]
                for twin, extra in zip(self._twins, self._extra, strict=True)
            ]
        )
        observations = np.empty((len(records), SIZE), np.float32)
        observations[:, ARM] = observation[ARM]
        observations[:, BALL] = np.concatenate(balls)
        np.clip(observations, self._low, self._high, out=observations)
        return {
            "observations": observations,
            "rewards": self._judge(records, observations[:, BALL.start + 1], over=over),
            "hits": self._hits.copy(),
            "ended": self._ended.copy(),
            "balls": self._numbers.copy(),
        }

    def positions(self) -> FloatArray:
        """(1 + N, 3) of the played ball and the extra ones [m]."""
        all_balls = [twin.all_balls(twin.row) for twin in self._twins]
        extra = [balls[its] for balls, its in zip(all_balls, self._extra, strict=True)]
        return np.concatenate([all_balls[0][:1], *extra])[:, :3]

    def _judge(self, records: NDArray[Any], y: NDArray[Any], *, over: bool) -> FloatArray:
        """The rewards (N,) that are paid now."""
        rewards = np.zeros(len(records))
        self._hits |= ~self._ended & (touched_balls(records))
        settled = settled_balls(records) | (y < self._end.passed_y)
        ending = ~self._ended & (settled | over)
        for ball in np.flatnonzero(ending):
            rewards[ball] = self._reward.reward(record_of(records[ball], float(y[ball])))
        self._ended |= ending
        return rewards
