"""Estimates flying balls from noisy measurements: position, velocity and top spin.

After each measurement, the estimate is the prediction of the last one by the laws of flight and
bounce, plus gain times innovation. Without a measurement, the estimate is the prediction. A
velocity that no flight and no bounce explains (a racket has hit the ball) restarts the filter.
One ball and many give the same bits.

The gains are from an extended Kalman filter along a typical shot. The effect of a spin depends on
the ball's velocity, which is similar for all shots. The gains therefore do not depend on the shot,
and are computed once, before the first ball flies.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, partial

import numpy as np

from o80.base.arrays import FloatArray
from o80_mujoco.balls import BallFilter, path, predicted_flight

from ..world.table import TABLE
from ..world.timing import STEP
from .aerodynamics import AIR
from .impact import platform

TYPICAL = (0.46, 2.95, 1.37, 0.24, -4.14, 2.28, 30.0)
"""Position, velocity and top spin of a typical launch: the ball gun's, with less spin."""
STEPS_AFTER = 40
"""Number of measurements after the bounce with separate gains; afterwards, the last gains hold.
"""

_ALONG_X = ((0, 0), (0, 3), (3, 0), (3, 3))
_ALONG_YZ = tuple((row, column) for row in (1, 2, 4, 5, 6) for column in (1, 2, 4, 5))
PLACES = _ALONG_X + _ALONG_YZ
"""Row of the estimate (7) and column of the measurement (6) of each gain. The others are 0, because
motion across the table is independent of motion along it."""


@dataclass(frozen=True)
class FilterSettings:
    """Standard deviations of measurements and of the ball's motion, assumed by the filter."""

    step: float = STEP
    """Interval of measurements [s]."""
    position: float = 0.005
    """Standard deviation of a measured position [m]."""
    velocity: float = 0.1
    """Standard deviation of a measured velocity [m/s]."""
    spin: float = 45.0
    """Prior standard deviation of a shot's spin [rad/s]."""
    mean_spin: float = 20.0
    """Prior mean of a shot's spin [rad/s]."""
    force: float = 0.3
    """Standard deviation of unmodelled accelerations, in each step [m/s^2]."""
    bounce_velocity: float = 0.1
    """Standard deviation of the bounce law's velocity [m/s]."""
    bounce_spin: float = 10.0
    """[rad/s]"""


@dataclass(frozen=True, eq=False)
class Gains:
    """Gains, a row for each measurement since the first sighting, or since the bounce."""

    before: FloatArray
    """(steps, 24), in the order of `PLACES`"""
    after: FloatArray
    """(STEPS_AFTER, 24)"""


def ball_filter(settings: FilterSettings, count: int) -> BallFilter:
    """Makes the filter of `count` balls."""
    table = gains(settings)
    return BallFilter(
        count=count,
        air=AIR,
        platform=platform(TABLE),
        before=table.before,
        after=table.after,
        step=settings.step,
        mean_spin=settings.mean_spin,
    )


@cache
def gains(settings: FilterSettings) -> Gains:
    """Computes the gains for these settings."""
    s = settings
    measured = np.diag([s.position**2] * 3 + [s.velocity**2] * 3)
    moved = np.zeros((7, 7))
    for axis in range(3):
        move = np.array([s.step**2 / 2, s.step])
        moved[np.ix_([axis, axis + 3], [axis, axis + 3])] = s.force**2 * np.outer(move, move)
    moved[6, 6] = 1.0
    bounce = np.diag([1e-6] * 3 + [s.bounce_velocity**2] * 3 + [s.bounce_spin**2])

    ball, covariance = np.array(TYPICAL), np.diag([*np.diag(measured), s.spin**2])
    before, bounced = [_gain(covariance, measured)], False
    after: list[FloatArray] = []
    while len(after) < STEPS_AFTER:
        slope = _slopes(partial(_flown, step=s.step), ball)
        before_step, ball = ball, _flown(ball[None], step=s.step)[0]
        covariance = slope @ covariance @ slope.T + moved
        if not bounced and ball[2] < TABLE.bounce_height:
            bounced = True
            slope = _slopes(_bounced, ball)
            ball = _past_table(before_step, step=s.step)
            covariance = slope @ covariance @ slope.T + bounce
        gain = _gain(covariance, measured)
        covariance = (np.eye(7) - gain @ np.eye(6, 7)) @ covariance
        (after if bounced else before).append(gain)
    return Gains(_table(before), _table(after))


def _gain(covariance: FloatArray, measured: FloatArray) -> FloatArray:
    """Kalman gain (7, 6) for the covariances of estimate and measurement."""
    gain: FloatArray = covariance[:, :6] @ np.linalg.inv(covariance[:6, :6] + measured)
    return gain


def _slopes(move: Callable[[FloatArray], FloatArray], ball: FloatArray) -> FloatArray:
    """Jacobian (7, 7) of `move` at a ball."""
    small = 1e-5
    moved = move(ball + np.vstack([np.zeros(7), small * np.eye(7)]))
    slopes: FloatArray = (moved[1:] - moved[0]).T / small
    return slopes


def _flown(balls: FloatArray, *, step: float) -> FloatArray:
    """Moves balls (n, 7) by a step [s] of free flight."""
    return path(_whole(balls), step, 1, AIR)[1, :, :7]


def _bounced(balls: FloatArray) -> FloatArray:
    """Bounces balls (n, 7) on the table."""
    return platform(TABLE).bounced(_whole(balls))[:, :7]


def _past_table(ball: FloatArray, *, step: float) -> FloatArray:
    """Moves a ball (7,) by a step [s] that contains a bounce."""
    whole = _whole(ball[None])[0]
    return predicted_flight(whole, AIR, platform(TABLE), step, step)[-1, 1:8]


def _whole(balls: FloatArray) -> FloatArray:
    """Converts balls (n, 7) with top spin only to (n, 9)."""
    return np.hstack([balls, np.zeros((len(balls), 2))])


def _table(rows: Sequence[FloatArray]) -> FloatArray:
    """Flattens gains to (rows, 24), in the order of `PLACES`."""
    return np.array([[row[place] for place in PLACES] for row in rows])
