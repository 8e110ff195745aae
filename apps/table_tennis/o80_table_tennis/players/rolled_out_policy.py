"""Action chunks from the policy that hits: it plays on, in advance, on what it predicts.

From an observation, and the pressures that are planned already, arm and ball are predicted until
the first row of the answer acts. There the policy of single actions is asked, its action is taken
into the prediction, and so on, row by row.
"""

from __future__ import annotations

import copy
import math
from collections import deque

import numpy as np
from numpy.typing import NDArray

from o80.base.arrays import Float32Array, FloatArray

from ..physics.prediction import PredictedFlight, predict
from ..settings import TaskSettings
from ..task.actions import changed_pressures
from ..task.observations import (
    BALL_POSITION,
    BALL_VELOCITY,
    JOINT_POSITIONS,
    JOINT_VELOCITIES,
    PRESSURES,
)
from ..world.arm import MUSCLES
from ..world.timing import ITERATIONS, PERIOD, STEP
from .hitting_policy import HittingPolicy, HittingSettings

SUBSTEPS = 4
"""Parts of a step of 10 ms in which the arm is predicted."""


class RolledOutPolicy:
    """Plays by the chunks of a task whose actions are not repeated."""

    def __init__(self, settings: HittingSettings, task: TaskSettings) -> None:
        if task.chunk_size is None or task.repeat != 1:
            raise ValueError("give a task with a chunk_size, and repeat=1")
        self._settings = settings
        self._size, self._steps, self._delay = task.chunk_size, task.action_steps, task.delay
        self._dead_time = np.repeat(settings.dead_time, 2)
        longest = task.delay * PERIOD + max(settings.dead_time)
        self._earlier = max(1, math.ceil(longest / STEP))
        self._commanded: deque[FloatArray] = deque(maxlen=self._earlier)
        self._policy = HittingPolicy(settings)
        self.reset()

    def reset(self) -> None:
        """A new episode begins."""
        self._policy.reset()
        self._commanded.clear()
        self._ball: PredictedFlight | None = None

    def act(self, observation: Float32Array) -> NDArray[np.float32]:
        """The chunk (chunk_size, 8) in [-1, 1] after `observation` (22,)."""
        row = observation.astype(np.float64)
        if not self._commanded:
            self._commanded.extend([np.clip(row[PRESSURES], 0.0, 1.0)] * self._earlier)
        flight = self._flight(row)
        commanded, policy = list(self._commanded), self._policy
        # a single action acts from the second iteration after what was seen
        ahead = self._delay - 1
        row = self._after(row, commanded, 0.0, ahead * PERIOD)
        actions: list[NDArray[np.float32]] = []
        for _ in range(self._size):
            if len(actions) == self._steps:
                # the other rows are for a late answer: what follows knows nothing of them
                policy = copy.deepcopy(policy)
            place = ahead + len(actions) * ITERATIONS
            row[BALL_POSITION] = flight.positions[place]
            row[BALL_VELOCITY] = flight.velocities[place]
            actions.append(policy.act(row.astype(np.float32)))
            factor = self._settings.factor
            commanded.append(changed_pressures(commanded[-1], actions[-1], factor=factor))
            row = self._after(row, commanded, place * PERIOD, STEP)
        self._commanded.extend(commanded[self._earlier : self._earlier + self._steps])
        return np.stack(actions)

    def _flight(self, row: FloatArray) -> PredictedFlight:
        """Flight of the ball, in iterations from now; its spin goes on from the last prediction."""
        spin: FloatArray = np.array(self._settings.interception.spin)
        if self._ball is not None:
            place = self._steps * ITERATIONS
            before, now = self._ball.velocities[: place + 1, 2], row[BALL_VELOCITY][2]
            spin = self._ball.spins[place]
            if before[0] < 0.0 < now and before[-1] < 0.0:  # it bounced sooner than predicted
                spin = self._ball.spins[-1]
        rows = self._delay + self._size * ITERATIONS
        self._ball = predict(
            row[BALL_POSITION], row[BALL_VELOCITY], rows * PERIOD, spin=spin, period=PERIOD
        )
        return self._ball

    def _after(
        self, row: FloatArray, commanded: list[FloatArray], time: float, duration: float
    ) -> FloatArray:
        """The observation `duration` [s] later; it is one of `time` [s] after the real one."""
        s, row = self._settings, row.copy()
        steps = math.ceil(duration / STEP * SUBSTEPS)
        for step in range(steps):
            part = duration / steps
            then = time + (step + 0.5) * part
            pressures = s.lag.after(row[PRESSURES], self._acting(commanded, then), part)
            torque = s.muscles.torque(pressures, row[JOINT_POSITIONS])
            speeds = s.arm.speeds_after(row[JOINT_POSITIONS], row[JOINT_VELOCITIES], torque, part)
            row[PRESSURES], row[JOINT_VELOCITIES] = pressures, speeds
            row[JOINT_POSITIONS] += part * speeds
        return row

    def _acting(self, commanded: list[FloatArray], time: float) -> FloatArray:
        """Pressures (8,) that act on the muscles at `time` [s], after the dead time of each."""
        since = (time - self._dead_time - self._delay * PERIOD) / STEP
        places = np.clip(self._earlier + np.floor(since), 0, len(commanded) - 1).astype(int)
        acting: FloatArray = np.array(commanded)[places, np.arange(MUSCLES)]
        return acting
