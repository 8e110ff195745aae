"""A policy that hits: it predicts the ball, plans a strike and drives the arm through it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..physics.impact import bounced
from ..task.actions import COARSE
from ..task.observations import (
    BALL_POSITION,
    BALL_VELOCITY,
    JOINT_POSITIONS,
    JOINT_VELOCITIES,
    PRESSURES,
    Float32Array,
)
from ..world.arm import JOINT_LIMIT, JOINTS
from ..world.scene import Vector
from ..world.table import TABLE
from ..world.timing import STEP
from .arm_dynamics import ArmModel
from .interception import ComingBall, InterceptionSettings, Strike, StrikePlanner, coming_ball
from .pressure_control import MusclePair, PressureActions, PressureLag
from .swing import JointMotion, Swing

FloatArray = NDArray[np.float64]

WRIST = 3
"""Index of joint 4."""
LOW = 0.1
"""A ball that begins to rise this near above the table has bounced [m]."""
PREDICTED_EVERY = 4
"""A predicted path of the ball is used for so many steps."""


@dataclass(frozen=True)
class ControlSettings:
    """How the arm is driven along its swing."""

    stiffness: float = 400.0
    """Of the feedback [1/s^2]."""
    damping: float = 30.0
    """Of the feedback [1/s]."""
    mean_pressure: float = 0.45
    """Mean normalised pressure of two antagonists."""
    begin: float = 0.003
    """Time from an observation to the effect of its action [s]."""
    ahead: float = 0.012
    """Time after the observation at which the action aims [s]."""
    settling: float = 0.014
    """Time in which the pressures should reach the wanted ones [s]."""
    wrist_stiffness: float = 12.0
    """Additional feedback of joint 4, whose inertia is very small [Nm/rad]."""
    learning: tuple[float, float, float, float] = (600.0, 600.0, 225.0, 120.0)
    """Integral gain of each joint, for torques that the model lacks [Nm/(rad s)]."""
    last_change: float = 0.03
    """From this time before the strike on, the swing is not changed any more [s]."""
    shortest: float = 0.02
    """Least duration of a swing, for balls that come sooner than predicted [s]."""
    follow_through: float = 0.03
    """The swing goes on this long after the strike, unless the ball flies back before [s]."""
    stop: float = 0.25
    """From the end of a swing to rest [s]."""


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
        self._lacking = np.zeros(JOINTS)
        self._swing: Swing | None = None
        self._ball: ComingBall | None = None
        self._steps = 0
        self._seen: FloatArray | None = None
        self._spin: Vector = self._settings.interception.spin
        self._over = False
        self.strike: Strike | None = None
        """What is planned now."""

    def act(self, observation: Float32Array) -> NDArray[np.float32]:
        """The action (8,) in [-1, 1] after `observation` (22,)."""
        row = observation.astype(np.float64)
        if self._swing is None:
            self._actions.start(row[PRESSURES])
            self._swing = Swing.resting_at(row[JOINT_POSITIONS])

        # ball => strike => swing => torques => pressures => action
        self._swing = self._plan(row[BALL_POSITION], row[BALL_VELOCITY], self._swing.later(STEP))
        return self._drive(row[JOINT_POSITIONS], row[JOINT_VELOCITIES], row[PRESSURES], self._swing)

    def _plan(self, position: FloatArray, velocity: FloatArray, swing: Swing) -> Swing:
        """The motion from now on, which was to be `swing`."""
        control = self._settings.control
        flying_back = velocity[1] > 0.0
        if self.strike is not None and self.strike.time <= control.last_change + STEP:
            # straight on through the ball
            self.strike = self.strike.later(STEP)
            if self.strike.time >= -control.follow_through and not flying_back:
                return swing
            self._over = True
        if self._over:
            self.strike = None
        else:
            self._follow(position, velocity)
            self.strike = None if self._ball is None else self._planner.plan(self._ball)
        now = swing.at(0.0)
        if self.strike is None:
            return Swing.between(now, _resting(now, control.stop), control.stop)
        end = JointMotion(self.strike.posture, self.strike.speeds, np.zeros(JOINTS))
        return Swing.between(now, end, max(self.strike.time, control.shortest))

    def _follow(self, position: FloatArray, velocity: FloatArray) -> None:
        """Predicts the ball, or goes on along its last predicted path."""
        self._spin = self._spin_after(position, velocity)
        self._seen = np.concatenate([position, velocity])
        if self._steps % PREDICTED_EVERY == 0:
            self._ball = coming_ball(
                position, velocity, self._settings.interception, spin=self._spin
            )
        elif self._ball is not None:
            self._ball = self._ball.later(STEP)
        self._steps += 1

    def _spin_after(self, position: FloatArray, velocity: FloatArray) -> Vector:
        """The spin of the ball, which a bounce since the last observation has changed."""
        low = position[2] < TABLE.bounce_height + LOW
        if self._seen is None or not (low and self._seen[5] < 0.0 < velocity[2]):
            return self._spin
        x, y, z, vx, vy, vz = self._seen.tolist()
        return bounced((x, y, z, vx, vy, vz), self._spin)[1]

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
        torque[WRIST] += control.wrist_stiffness * q_error[WRIST]
        self._lacking += STEP * np.array(control.learning) * (start.q - q)
        torque += self._lacking
        in_muscles = s.muscles.pressures(torque, wanted.q, control.mean_pressure).ravel()
        begin = s.lag.after(pressures, self._actions.asked, control.begin)
        return self._actions.towards(s.lag.asking(begin, in_muscles, control.settling))


def _resting(now: JointMotion, stop: float) -> JointMotion:
    """Where the joints come to rest without haste."""
    q = np.clip(now.q + 0.5 * stop * now.dq, -0.95 * JOINT_LIMIT, 0.95 * JOINT_LIMIT)
    return JointMotion(q, np.zeros(JOINTS), np.zeros(JOINTS))
