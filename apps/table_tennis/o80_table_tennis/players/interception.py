"""Plans strikes that send the ball to the target.

A strike has three unknowns: its time, the angle of the wrist, and the speed of joint 1. The time
determines the place of the ball, and so the angles of joints 1 to 3; all three determine the
velocity of the leaving ball. Least squares finds the strike that sends the ball to the target,
with a preference for comfortable strikes.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from o80.base.arrays import FloatArray
from o80_mujoco.balls import path

from ..physics.aerodynamics import AERODYNAMICS
from ..physics.impact import Leaving, leaving
from ..physics.prediction import predict
from ..world.arm import BLADE_THICKNESS, racket_pose
from ..world.ball import BALL_GUN_SPIN, BALL_RADIUS
from ..world.scene import Vector
from ..world.table import TABLE
from .inverse_kinematics import posture_towards

PATH_PERIOD = 0.01
"""Period of the rows of a predicted path [s]."""
TOUCH = BALL_RADIUS + BLADE_THICKNESS / 2
"""Distance from the middle of the blade to the centre of a touching ball [m]."""
LATEST = 1.6
"""Longest time of a predicted path [s]."""
STEPS, CORRECTIONS = 6, 2
"""Steps of the flight to the target, and corrections of its initial velocity."""
AIR = replace(AERODYNAMICS, spin_decay=0.0).air
FIRST_ROUNDS = 4
"""Iterations for a ball's first strike; later searches start at the last one and need one."""


@dataclass(frozen=True)
class Strike:
    """A motion of the racket through the ball."""

    time: float
    """Time from now [s]."""
    posture: FloatArray
    """(4,) [rad]"""
    speeds: FloatArray
    """(4,) [rad/s]"""

    def later(self, time: float) -> Strike:
        """Returns the strike as seen `time` [s] later."""
        return replace(self, time=self.time - time)


@dataclass(frozen=True)
class InterceptionSettings:
    """Target, limits and preferences of strikes."""

    target_x: float = -0.011334484200464848
    """Target of the ball on the table [m]."""
    target_y: float = 2.5272907045719197
    """[m]"""
    flight: float = 0.5376000137690394
    """Duration of the flight to the target [s]."""
    nearest: float = -0.15
    """Least y of a strike [m]."""
    farthest: float = 0.30
    """Largest y of a strike [m]."""
    fastest: float = 4.0
    """Limit of the speed of joint 1 [rad/s]."""
    steepest: float = 1.2
    """Limit of the wrist's angle, either way [rad]."""
    comfortable_y: float = 0.1185812861960035
    """Preferred y of a strike [m]."""
    comfortable_wrist: float = 0.3
    """Preferred angle of joint 4 [rad]."""
    comfortable_speed: float = 1.5
    """Preferred speed of joint 1 [rad/s]."""
    discomfort: Vector = (0.2, 0.05, 0.02)
    """Weights of deviations from the preferences, relative to velocity errors [1/s, m/s, m]."""
    off_middle: float = 8.0
    """Weight of a touch off the middle of the blade, relative to velocity errors [1/s]."""
    spin: Vector = BALL_GUN_SPIN
    """Assumed spin of an approaching ball, before its bounce [rad/s]."""


@dataclass(frozen=True)
class ComingBall:
    """Part of a predicted path on which the ball can be hit."""

    times: FloatArray
    """(N,) from now [s]"""
    positions: FloatArray
    """(N, 3) [m]"""
    velocities: FloatArray
    """(N, 3) [m/s]"""
    spin: FloatArray
    """(3,) [rad/s], about constant while the ball can be hit"""

    def later(self, time: float) -> ComingBall:
        """Returns the path as seen `time` [s] later."""
        return replace(self, times=self.times - time)

    def at(self, time: float) -> tuple[FloatArray, FloatArray]:
        """Interpolates position and velocity (3,) at `time` from now, within the path."""
        row = int(np.clip((time - self.times[0]) / PATH_PERIOD, 0, len(self.times) - 2))
        share = (time - self.times[row]) / PATH_PERIOD
        change = self.velocities[row + 1] - self.velocities[row]
        velocity = self.velocities[row] + share * change
        mean = self.velocities[row] + 0.5 * share * change
        return self.positions[row] + share * PATH_PERIOD * mean, velocity

    def time_at(self, y: float) -> float:
        """Returns the time at which the ball is at `y`, or nearest to it [s]."""
        return float(np.interp(-y, -self.positions[:, 1], self.times))


def coming_ball(
    position: FloatArray,
    velocity: FloatArray,
    settings: InterceptionSettings,
    spin: Vector | FloatArray | None = None,
) -> ComingBall | None:
    """Predicts the path on which a ball can be hit, after its bounce; None if there is none.

    `spin`: present spin [rad/s]; None: the spin of `settings`, before the bounce.
    """
    if velocity[1] > -0.5 or position[1] < settings.nearest:
        return None
    duration = min(LATEST, 1.6 * (position[1] - settings.nearest) / -velocity[1] + 0.1)
    spin = settings.spin if spin is None else spin
    flight = predict(position, velocity, duration, spin=spin, period=PATH_PERIOD)
    rising = np.flatnonzero(np.diff(flight.velocities[:, 2]) > 0.0)
    first = int(rising[-1]) + 2 if len(rising) else 0
    y = flight.positions[:, 1]
    near = np.flatnonzero((y <= settings.farthest + 0.03) & (y >= settings.nearest - 0.03))
    near = near[near >= first]
    if len(near) < 2:
        return None
    rows = slice(int(near[0]), int(near[-1]) + 1)
    middle = (rows.start + rows.stop) // 2
    return ComingBall(
        flight.stamps[rows], flight.positions[rows], flight.velocities[rows], flight.spins[middle]
    )


class StrikePlanner:
    """Finds strikes; each search begins at the last strike."""

    def __init__(self, settings: InterceptionSettings) -> None:
        self._settings = settings
        self.forget()

    def forget(self) -> None:
        """Forgets the last strike, before a new ball."""
        self._place = self._settings.comfortable_y
        self._wrist = self._settings.comfortable_wrist
        self._speed = self._settings.comfortable_speed
        self._found = False

    def plan(self, ball: ComingBall) -> Strike:
        """Finds the strike that sends the ball nearest to the target."""
        s = self._settings
        low = np.array([ball.time_at(s.farthest), -s.steepest, 0.0])
        high = np.array([ball.time_at(s.nearest), s.steepest, s.fastest])
        comfort = np.array(
            [ball.time_at(s.comfortable_y), s.comfortable_wrist, s.comfortable_speed]
        )
        _, velocity = ball.at(float(comfort[0]))
        discomfort = np.array(s.discomfort) * [abs(float(velocity[1])), 1.0, 1.0]

        # Gauss-Newton, clamped to the limits
        guess = np.clip([ball.time_at(self._place), self._wrist, self._speed], low, high)
        probe = np.array([0.004, 0.02, 0.05])
        for _ in range(1 if self._found else FIRST_ROUNDS):
            wanted = self._wanted(ball, guess)
            error = self._error(ball, guess, wanted)
            slopes = np.empty((len(error), 3))
            for i in range(3):
                moved = guess.copy()
                moved[i] += probe[i]
                slopes[:, i] = (self._error(ball, moved, wanted) - error) / probe[i]
            matrix = slopes.T @ slopes + np.diag(discomfort**2)
            right = discomfort**2 * (comfort - guess) - slopes.T @ error
            guess = np.clip(guess + np.linalg.solve(matrix, right), low, high)

        # guess => strike, start of the next search
        position, _ = ball.at(float(guess[0]))
        self._place, self._wrist, self._speed = float(position[1]), float(guess[1]), float(guess[2])
        self._found = True
        speeds = np.array([self._speed, 0.0, 0.0, 0.0])
        return Strike(float(guess[0]), touching_posture(position, self._wrist), speeds)

    def _wanted(self, ball: ComingBall, guess: FloatArray) -> FloatArray:
        """Computes the velocity (3,) of the leaving ball that reaches the target."""
        s = self._settings
        position, _ = ball.at(float(guess[0]))
        target = np.array([s.target_x, s.target_y, TABLE.bounce_height])
        spin = self._leaving(ball, guess)[0].spin
        # starts with a flight without air, then corrects the miss
        velocity: FloatArray = (target - position) / s.flight
        velocity[2] += 0.5 * AERODYNAMICS.gravity * s.flight
        for _ in range(CORRECTIONS):
            leaving = np.concatenate([position, velocity, spin])[np.newaxis]
            landing = path(leaving, s.flight / STEPS, STEPS, AIR)[-1, 0, :3]
            velocity = velocity + (target - landing) / s.flight
        return velocity

    def _error(self, ball: ComingBall, guess: FloatArray, wanted: FloatArray) -> FloatArray:
        """Residuals (6,): velocity of the leaving ball minus `wanted`, and weighted offset."""
        after, off = self._leaving(ball, guess)
        return np.concatenate([after.velocity - wanted, self._settings.off_middle * off])

    def _leaving(self, ball: ComingBall, guess: FloatArray) -> tuple[Leaving, FloatArray]:
        """Computes the ball after the strike, and its offset from the blade's middle (3,) [m]."""
        position, velocity = ball.at(float(guess[0]))
        speed = float(guess[2])
        pose = racket_pose(touching_posture(position, float(guess[1])))
        normal = np.array(pose.normal)
        racket = np.array([-speed * position[1], speed * position[0], 0.0])
        after = leaving(velocity, ball.spin, racket, normal)
        return after, position - TOUCH * normal - np.array(pose.position)


def touching_posture(ball: FloatArray, wrist: float) -> FloatArray:
    """Computes angles (4,) [rad] at which the racket's face touches a ball within reach."""
    x, y, z = ball.tolist()
    nx, ny, nz = racket_pose(posture_towards((x, y, z), wrist)).normal
    return posture_towards((x - TOUCH * nx, y - TOUCH * ny, z - TOUCH * nz), wrist)
