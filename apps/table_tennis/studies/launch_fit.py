"""Fits a distribution to recorded launches, and compares simulated with recorded shots.

A shot is 9 numbers at the first row (position, velocity, spin) and 9 more: time and place of the
bounce, and time, place and velocity at the racket's plane. A distribution is fitted to the
launches of one half of a set, and compared with the other half, number by number.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from o80.base.arrays import FloatArray
from o80_table_tennis.balls.flight_fit import FlightFit
from o80_table_tennis.balls.launches import Launch
from o80_table_tennis.balls.trajectories import BallTrajectory
from o80_table_tennis.physics.prediction import predict

PLANE = 0.3
"""y of the racket's plane [m]."""
STEP = 0.001
"""Interval of a flight's rows [s]."""
NAMES = (
    *("x", "y", "z", "vx", "vy", "vz", "wx", "wy", "wz"),
    *("bounce time", "bounce x", "bounce y"),
    *("crossing time", "crossing x", "crossing z"),
    *("crossing vx", "crossing vy", "crossing vz"),
)
LAUNCH = slice(0, 9)
"""Columns of the launch."""


def halves(count: int) -> tuple[FloatArray, FloatArray]:
    """Splits shot numbers, in a fixed random order, into those to fit and those to test."""
    shuffled = np.random.default_rng(0).permutation(count)
    return np.sort(shuffled[: count // 2]), np.sort(shuffled[count // 2 :])


def fitted(launches: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Computes mean (9,) and covariance (9, 9) of launches (N, 9)."""
    return launches.mean(axis=0), np.cov(launches.T)


def recorded_numbers(shots: Sequence[BallTrajectory]) -> FloatArray:
    """Returns the numbers (N, 18) of recorded shots that bounce and then reach the plane."""
    rows = [_recorded(shot.fit) for shot in shots]
    return np.array([row for row in rows if row is not None])


def simulated_numbers(launches: Sequence[Launch]) -> FloatArray:
    """Returns the numbers (N, 18) of predicted flights from launches."""
    return np.array([_predicted(launch) for launch in launches])


def _recorded(fit: FlightFit) -> list[float] | None:
    if not len(fit.bounce_times):
        return None
    bounce = fit.bounce_times[:1]
    times = np.arange(bounce[0], fit.end, STEP)
    positions, velocities = fit.at(times)
    if not (positions[:, 1] < PLANE).any():
        return None
    row = int(np.argmax(positions[:, 1] < PLANE))
    first = fit.at(np.array([fit.start]))
    spin = fit.spins(np.array([fit.start]), first[1])[0]
    place = fit.at(bounce)[0][0]
    return [
        *(*first[0][0], *first[1][0], *spin),
        *(float(bounce[0]) - fit.start, *place[:2]),
        *(float(times[row]) - fit.start, *positions[row, [0, 2]], *velocities[row]),
    ]


def _predicted(launch: Launch) -> list[float]:
    flight = predict(launch.position, launch.velocity, 2.0, spin=launch.spin, period=STEP)
    row = int(np.argmax(flight.positions[:, 1] < PLANE))
    assert row, "a shot that can be played reaches the plane"
    time = float(flight.bounce_times[0])
    return [
        *(*launch.position, *launch.velocity, *launch.spin),
        *(time, *flight.positions[round(time / STEP), :2]),
        *(flight.stamps[row], *flight.positions[row, [0, 2]], *flight.velocities[row]),
    ]


def probability_of_same(one: FloatArray, other: FloatArray) -> float:
    """Computes the p-value of the two-sample Kolmogorov-Smirnov test of samples (N,) and (M,)."""
    one, other = np.sort(one), np.sort(other)
    places = np.concatenate([one, other])
    below = [np.searchsorted(each, places, side="right") / len(each) for each in (one, other)]
    largest = float(np.abs(below[0] - below[1]).max())
    root = np.sqrt(len(one) * len(other) / (len(one) + len(other)))
    scaled = (root + 0.12 + 0.11 / root) * largest
    if scaled < 0.2:  # the series below converges slowly there
        return 1.0
    k = np.arange(1, 101)
    return float(np.clip(2 * np.sum((-1.0) ** (k - 1) * np.exp(-2 * (k * scaled) ** 2)), 0, 1))
