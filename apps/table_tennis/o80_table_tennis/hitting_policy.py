"""A policy that hits: it predicts the ball, plans a strike and drives the arm through it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from .actions import COARSE
from .arm_dynamics import ArmModel
from .interception import ComingBall, InterceptionSettings, Strike, StrikePlanner, coming_ball
from .kinematics import JOINT_LIMIT, JOINTS
from .observations import (
    BALL_POSITION,
    BALL_VELOCITY,
    JOINT_POSITIONS,
    JOINT_VELOCITIES,
    PRESSURES,
    Float32Array,
)
from .pressure_control import STEP, MusclePair, PressureActions, PressureLag
from .swing import JointMotion, Swing

FloatArray = NDArray[np.float64]

PREDICTED_EVERY = 4
"""Steps between two predictions of the ball; a path serves that long."""


@dataclass(frozen=True)
class ControlSettings:
    """How the arm is driven along its swing."""

    stiffness: float = 220.0
    """Of the feedback [1/s^2]."""
    damping: float = 22.0
    """Of the feedback [1/s]."""
    mean_pressure: float = 0.45
    """Of two muscles against each other."""
    begin: float = 0.003
    """From an observation to when its action acts [s]."""
    ahead: float = 0.012
    """How far ahead of its observation the action aims [s]."""
    settling: float = 0.014
    """Time the pressures are given to come to what is wanted [s]."""
    stop: float = 0.25
    """From the strike to rest [s]."""


@dataclass(frozen=True)
class HittingSettings:
    """Everything the policy can be told."""

    interception: InterceptionSettings = field(default_factory=InterceptionSettings)
    control: ControlSettings = field(default_factory=ControlSettings)
    arm: ArmModel = field(default_factory=ArmModel)
    muscles: MusclePair = field(default_factory=MusclePair)
    lag: PressureLag = field(default_factory=PressureLag)
    factor: float = COARSE
    """Of the environment's actions."""


class HittingPolicy:
    """Meets each ball with the racket so that it flies back to the other side."""

    def __init__(self, settings: HittingSettings | None = None) -> None:
        self._settings = settings or HittingSettings()
        self._planner = StrikePlanner(self._settings.interception)
        self._actions = PressureActions(factor=self._settings.factor)
        self.reset()

    def reset(self) -> None:
        """A new episode begins."""
        self._planner.forget()
        self._reference: JointMotion | None = None
        self._ball: ComingBall | None = None
        self._steps = 0
        self.strike: Strike | None = None
        """What is planned now."""

    def act(self, observation: Float32Array) -> NDArray[np.float32]:
        """The action (8,) in [-1, 1] after `observation` (22,)."""
        row = observation.astype(np.float64)
        if self._reference is None:
            self._actions.start(row[PRESSURES])
            self._reference = JointMotion.at_rest(row[JOINT_POSITIONS])

        # ball => strike => swing
        swing = self._plan(row[BALL_POSITION], row[BALL_VELOCITY], self._reference)
        self._reference = swing.at(STEP)

        # swing => torques => pressures => action
        return self._drive(row[JOINT_POSITIONS], row[JOINT_VELOCITIES], row[PRESSURES], swing)

    def _plan(self, position: FloatArray, velocity: FloatArray, now: JointMotion) -> Swing:
        """The motion from now on."""
        self._follow(position, velocity)
        self.strike = None if self._ball is None else self._planner.plan(self._ball)
        if self.strike is None:
            stop = self._settings.control.stop
            return Swing.between(now, _resting(now, stop), stop)
        end = JointMotion(self.strike.posture, self.strike.speeds, np.zeros(JOINTS))
        return Swing.between(now, end, max(self.strike.time, 2.5 * STEP))

    def _follow(self, position: FloatArray, velocity: FloatArray) -> None:
        """Predicts the ball anew, or goes on along what was predicted."""
        flying_back = velocity[1] > 0.0
        if flying_back or self._steps % PREDICTED_EVERY == 0:
            self._ball = coming_ball(position, velocity, self._settings.interception)
        elif self._ball is not None:
            self._ball = self._ball.later(STEP)
        self._steps += 1

    def _drive(
        self, q: FloatArray, dq: FloatArray, pressures: FloatArray, swing: Swing
    ) -> NDArray[np.float32]:
        s, control = self._settings, self._settings.control
        wanted = swing.at(control.ahead)
        start = swing.at(0.0)
        # where the arm will be: as far from the swing as it is now, going on at its speed
        q_error = (start.q - q) + control.ahead * (start.dq - dq)
        dq_error = start.dq - dq
        acceleration = wanted.ddq + control.stiffness * q_error + control.damping * dq_error
        torque = s.arm.torque(wanted.q, wanted.dq, acceleration)
        in_muscles = s.muscles.pressures(torque, wanted.q, control.mean_pressure).ravel()
        begin = s.lag.after(pressures, self._actions.asked, control.begin)
        return self._actions.towards(s.lag.asking(begin, in_muscles, control.settling))


def _resting(now: JointMotion, stop: float) -> JointMotion:
    """Where the joints come to rest without haste."""
    q = np.clip(now.q + 0.5 * stop * now.dq, -0.95 * JOINT_LIMIT, 0.95 * JOINT_LIMIT)
    return JointMotion.at_rest(q)
