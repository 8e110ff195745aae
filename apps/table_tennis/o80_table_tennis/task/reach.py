"""The task without a ball: bring the racket to a point and stay slow there."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from o80.base.arrays import Float32Array, FloatArray

from ..world.arm import JOINT_LIMIT, JOINTS, PLAYING_POSTURE, racket_pose
from .end import MAX_STEPS, End
from .observations import JOINT_POSITION_BOUND, JOINT_VELOCITY_BOUND
from .state import State


@dataclass(frozen=True)
class ReachTask:
    """Each step costs the distance of the racket's centre from the goal until the racket is there.

    Goals are where the racket is at postures drawn about the one in which episodes begin. Observed
    are the joints (8), the pressures (8), the centre of the racket (3) and the goal (3).
    """

    tolerance: float = 0.03
    """The racket has reached a goal that is at most this far away [m], unless it moves."""
    resting_speed: float = 0.5
    """It counts as moving if a joint is faster than this [rad/s]."""
    spread: float = 0.4
    """Largest difference of a drawn posture from the start, on each joint [rad]."""
    max_steps: int = MAX_STEPS
    """Steps of the environment after which an episode is truncated."""
    joint_velocity: float = JOINT_VELOCITY_BOUND
    """Bound of the observation, either way [rad/s]."""

    plays_ball = False

    @property
    def low(self) -> Float32Array:
        """(22,)"""
        bounds = (
            [-JOINT_POSITION_BOUND] * 4
            + [-self.joint_velocity] * 4
            + [0.0] * 8
            + [-2.0, -2.0, 0.0] * 2
        )
        return np.array(bounds, dtype=np.float32)

    @property
    def high(self) -> Float32Array:
        """(22,)"""
        bounds = (
            [JOINT_POSITION_BOUND] * 4 + [self.joint_velocity] * 4 + [1.0] * 8 + [2.0, 2.0, 3.0] * 2
        )
        return np.array(bounds, dtype=np.float32)

    def begin(self, rng: np.random.Generator) -> FloatArray:
        """A point (3,) that the racket can reach [m]."""
        posture = np.array(PLAYING_POSTURE) + rng.uniform(-self.spread, self.spread, JOINTS)
        return np.array(racket_pose(np.clip(posture, -JOINT_LIMIT, JOINT_LIMIT)).position)

    def observe(self, state: State) -> FloatArray:
        """(..., 22)"""
        parts = (state.motion, state.pressures, state.racket, state.goal)
        return np.concatenate(parts, axis=-1)

    def eventful(self, state: State) -> Any:
        """(...) true: every step is paid."""
        return np.ones(np.shape(state.steps), np.bool_)

    def end(self, state: State) -> NDArray[np.int64]:
        """(...) the goal is reached, or the steps are over."""
        slow = np.abs(state.joint_velocities).max(axis=-1) <= self.resting_speed
        reached = (self._distance(state) <= self.tolerance) & slow
        over = np.where(np.asarray(state.steps) >= self.max_steps, End.OUT_OF_STEPS, End.RUNNING)
        return np.where(reached, End.GOAL, over).astype(np.int64)

    def reward(self, state: State) -> FloatArray:
        """(...) minus the distance from the goal [m]."""
        return -self._distance(state)

    def info(self, state: State) -> dict[str, Any]:
        """`distance` of the racket's centre from the goal [m], `goal` (..., 3) [m]."""
        return {"distance": self._distance(state), "goal": np.array(state.goal)}

    def _distance(self, state: State) -> FloatArray:
        distance: FloatArray = np.linalg.norm(state.racket - state.goal, axis=-1)
        return distance
