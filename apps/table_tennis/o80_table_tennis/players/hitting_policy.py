"""Scripted policy: predicts the ball, plans a strike and drives the arm through the strike.

An arm with dead time reacts late. Planning and control are therefore for the time at which an
action begins to act: ball and arm are predicted to it, the arm from the actions in flight.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field
from typing import Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

import o80
from o80.base.arrays import Float32Array, FloatArray

from ..physics.impact import bounced
from ..rig.pressure_range import PressureRange
from ..rig.rig import arm_options
from ..settings import RigSettings
from ..task.actions import COARSE
from ..task.observations import (
    BALL_POSITION,
    BALL_VELOCITY,
    JOINT_POSITIONS,
    JOINT_VELOCITIES,
    PRESSURES,
)
from ..world.arm import JOINT_LIMIT, JOINTS, MUSCLES
from ..world.scene import Vector
from ..world.table import TABLE
from ..world.timing import STEP
from .arm_dynamics import ArmModel
from .arm_prediction import ArmPredictor, ArmState
from .interception import ComingBall, InterceptionSettings, Strike, StrikePlanner, coming_ball
from .pressure_control import MusclePair, PressureActions, PressureLag
from .swing import JointMotion, Swing

WRIST = 3
"""Index of joint 4."""
LOW = 0.1
"""Height above the table below which a rising ball has bounced [m]."""
PREDICTED_EVERY = 4
"""Number of steps for which a predicted path of the ball is used."""


@dataclass(frozen=True)
class ControlSettings:
    """Settings of the control along a swing. A search on simulated shots found the odd numbers."""

    stiffness: float = 412.5150855132902
    """Stiffness of the feedback [1/s^2]."""
    damping: float = 28.33154073951581
    """Damping of the feedback [1/s]."""
    mean_pressure: float = 0.45934124867561194
    """Mean normalised pressure of two antagonists."""
    begin: float = 0.003
    """Time from an observation to the effect of its action [s]."""
    ahead: float = 0.016792337953590822
    """Time after the observation for which the action is computed [s]."""
    settling: float = 0.015620133347269057
    """Time in which the pressures should reach their targets [s]."""
    wrist_stiffness: float = 12.0
    """Additional feedback of joint 4, whose inertia is very small [Nm/rad]."""
    learning: tuple[float, float, float, float] = (600.0, 600.0, 225.0, 120.0)
    """Integral gain of each joint, for unmodelled torques [Nm/(rad s)]."""
    last_change: float = 0.03
    """Time before the strike from which on the swing is fixed [s]."""
    shortest: float = 0.02
    """Least duration of a swing, for balls that arrive earlier than predicted [s]."""
    follow_through: float = 0.03
    """Continuation of the swing after the strike, unless the ball flies back earlier [s]."""
    stop: float = 0.25
    """Time from the end of a swing to rest [s]."""


@dataclass(frozen=True)
class HittingSettings:
    """Settings of the policy; the defaults are for the standard arm."""

    interception: InterceptionSettings = field(default_factory=InterceptionSettings)
    control: ControlSettings = field(default_factory=ControlSettings)
    arm: ArmModel = field(default_factory=ArmModel)
    muscles: MusclePair = field(default_factory=MusclePair)
    lag: PressureLag = field(default_factory=PressureLag)
    dead_time: tuple[float, ...] = (0.0,) * JOINTS
    """Dead time of the muscles of each joint [s]."""
    factor: float = COARSE
    """Factor of the environment's actions."""

    @classmethod
    def of_rig(cls, rig: RigSettings) -> HittingSettings:
        """Makes the settings for a rig's arm, by starting one and reading its description."""
        if rig.attach:
            with o80.Frontend(str(rig.arm_segment)) as arm:
                return cls.of(arm)
        with o80.robots.load("pam").inline(**arm_options(rig)) as arm:
            return cls.of(arm)

    @classmethod
    def of(cls, arm: o80.Frontend) -> HittingSettings:
        """Makes the settings for a running arm. Raises ValueError for an incomplete description."""
        custom = ElementTree.fromstring(arm.model).find("custom") if arm.model else None
        if custom is None:
            raise ValueError(
                f"the arm '{arm.segment}' does not describe its muscles: attach to a robot `pam` "
                "of this version, or give the player HittingSettings of your own"
            )
        told = {each.get("name"): each.get("data") or "" for each in custom.iter("numeric")}

        def numbers(name: str, count: int = JOINTS) -> Any:
            values = tuple(float(each) for each in told.get(name, "").split())
            if len(values) != count:
                raise ValueError(
                    f"the arm '{arm.segment}' has {len(values)} numbers of {name}, not {count}"
                )
            return values

        idle, full = (
            np.array(numbers(name, MUSCLES)) for name in ("idle_pressure", "full_pressure")
        )
        limits = PressureRange.of(arm)
        least, most = (
            tuple(map(tuple, ((each - idle) / (full - idle)).reshape(JOINTS, 2).tolist()))
            for each in (limits.least, limits.most)
        )
        muscles = MusclePair(
            pulley=numbers("pulley_radius", 1)[0],
            maximum_force=numbers("maximum_force"),
            stroke=numbers("stroke"),
            contracted=numbers("contraction", 1)[0],
            neutral=numbers("neutral"),
            directions=numbers("directions"),
            least=least,
            most=most,
        )
        return cls(
            muscles=muscles,
            lag=PressureLag(tuple(np.repeat(numbers("lag"), 2).tolist())),
            dead_time=numbers("dead_time"),
            arm=ArmModel(damping=numbers("damping")),
        )


class HittingPolicy:
    """Hits each ball so that it flies back to the other side."""

    def __init__(self, settings: HittingSettings | None = None) -> None:
        self._settings = settings or HittingSettings()
        self._planner = StrikePlanner(self._settings.interception)
        self._actions = PressureActions(factor=self._settings.factor)
        s = self._settings
        self._predictor = ArmPredictor(s.arm, s.muscles, s.lag, s.dead_time, s.control.begin)
        self._ahead = self._predictor.longest
        """Time after an observation for which all is planned [s]."""
        self._planned: deque[Swing] = deque(maxlen=1 + math.ceil(self._ahead / STEP))
        self.reset()

    def reset(self) -> None:
        """Begins a new episode."""
        self._planner.forget()
        self._integral = np.zeros(JOINTS)
        self._swing: Swing | None = None
        self._ball: ComingBall | None = None
        self._steps = 0
        self._seen: FloatArray | None = None
        self._spin: Vector = self._settings.interception.spin
        self._over = False
        self.strike: Strike | None = None
        """Planned strike."""

    def act(self, observation: Float32Array) -> NDArray[np.float32]:
        """Computes the action (8,) in [-1, 1] after `observation` (22,)."""
        row = observation.astype(np.float64)
        if self._swing is None:
            self._actions.start(row[PRESSURES])
            self._predictor.start(self._actions.commanded)
            self._swing = Swing.resting_at(row[JOINT_POSITIONS])
            self._planned.clear()

        # ball => strike => swing => torques => pressures => action
        self._swing = self._plan(row[BALL_POSITION], row[BALL_VELOCITY], self._swing.later(STEP))
        self._planned.append(self._swing)
        seen = ArmState(row[JOINT_POSITIONS], row[JOINT_VELOCITIES], row[PRESSURES])
        action = self._drive(self._predictor.predict(seen))
        self._predictor.ask(self._actions.commanded)
        return action

    def _plan(self, position: FloatArray, velocity: FloatArray, swing: Swing) -> Swing:
        """Plans the motion from now on; `swing` is the last plan."""
        control = self._settings.control
        flying_back = velocity[1] > 0.0
        if self.strike is not None and self.strike.time <= control.last_change + STEP:
            # keeps the swing through the ball
            self.strike = self.strike.later(STEP)
            if self.strike.time >= -control.follow_through and not flying_back:
                return swing
            self._over = True
        if self._over:
            self.strike = None
        else:
            self._follow(position, velocity)
            ball = None if self._ball is None else self._ball.later(self._ahead)
            self.strike = None if ball is None else self._planner.plan(ball)
        now, still = swing.at(0.0), np.zeros(JOINTS)
        if self.strike is None:  # brings the joints to rest slowly
            rest = now.q + 0.5 * control.stop * now.dq
            rest = np.clip(rest, -0.95 * JOINT_LIMIT, 0.95 * JOINT_LIMIT)
            return Swing.between(now, JointMotion(rest, still, still), control.stop)
        end = JointMotion(self.strike.posture, self.strike.speeds, still)
        return Swing.between(now, end, max(self.strike.time, control.shortest))

    def _follow(self, position: FloatArray, velocity: FloatArray) -> None:
        """Predicts the path of the ball; an unseen ball continues on its last predicted path."""
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
        """Returns the ball's spin, changed by a bounce since the last observation."""
        low = position[2] < TABLE.bounce_height + LOW
        if self._seen is None or not (low and self._seen[5] < 0.0 < velocity[2]):
            return self._spin
        wx, wy, wz = bounced(self._seen[3:], np.array(self._spin)).spin.tolist()
        return wx, wy, wz

    def _wanted(self, after: float) -> JointMotion:
        """Returns the planned motion of each joint, `after` [s] its dead time."""
        motions = [self._planned_at(dead_time + after) for dead_time in self._settings.dead_time]
        return JointMotion(
            *(
                np.array([getattr(motion, name)[joint] for joint, motion in enumerate(motions)])
                for name in ("q", "dq", "ddq")
            )
        )

    def _planned_at(self, time: float) -> JointMotion:
        """Returns the motion in `time` [s] from now, from the plan that was made for that time."""
        early = self._ahead - time
        back = min(max(math.ceil(early / STEP - 1e-9), 0), len(self._planned) - 1)
        # older plans began earlier
        return self._planned[-1 - back].at(max(0.0, back * STEP - early))

    def _drive(self, arm: ArmState) -> NDArray[np.float32]:
        s, control = self._settings, self._settings.control
        wanted, start = self._wanted(control.ahead), self._wanted(0.0)
        q, pressures = arm.q, arm.pressures
        # the deviation from the swing is extrapolated by its speed
        q_error = (start.q - q) + control.ahead * (start.dq - arm.dq)
        dq_error = start.dq - arm.dq
        acceleration = wanted.ddq + control.stiffness * q_error + control.damping * dq_error
        torque = s.arm.torque(wanted.q, wanted.dq, acceleration)
        torque[WRIST] += control.wrist_stiffness * q_error[WRIST]
        self._integral += STEP * np.array(control.learning) * (start.q - q)
        torque += self._integral
        in_muscles = s.muscles.pressures(torque, wanted.q, control.mean_pressure).ravel()
        begin = s.lag.after(pressures, self._actions.commanded, control.begin)
        return self._actions.towards(s.lag.asking(begin, in_muscles, control.settling))
