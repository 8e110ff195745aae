"""Fits the launch model to recorded shots: `python -m o80_devices.ball_launcher.fit FILES`.

Least squares fits nine numbers of the model: the simulated flights, bounces included, must
be as close as possible to all recorded positions. The numbers are fitted to one
half of the shots and tested on the other half. For the scatter, each shot is then fitted alone by
its speed, azimuth, altitude and spin.

The constants of `LAUNCH_MODEL` are fitted to the 25 published shots (`mn5008_no_spin`,
`mn5008_topspin`); the scatter is rounded. The ranges of the angles are assumed.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

import o80
from o80.base.arrays import FloatArray
from o80.base.descriptors import open_standard_streams
from o80.base.extras import needed
from o80.errors import InvalidArgument
from o80_devices.ball_launcher.launch_model import LAUNCH_MODEL, Launch, LaunchModel
from o80_devices.ball_launcher.recorded_shots import Setting, Shot, recorded_shots
from o80_devices.cameras.flight import Flight, FlightLaw, Table

TABLE = Table(middle=(1.38, 0.0, 0.742), half=(1.37, 0.7625))
"""Table in the frame of the launcher; the height is read from the recorded bounces."""
SCALES = {
    "y": 0.01,
    "z": 0.01,
    "azimuth": 0.01,
    "altitude": 0.01,
    "lift": 1e-5,
    "top_gain": 5e-5,
    "bottom_gain": 5e-5,
    "spin": 10.0,
    "spin_gain": 0.01,
}
"""Fitted numbers and their typical sizes; `y` and `z` are the place of the muzzle."""
START = LaunchModel(
    muzzle=(0.0, 0.0, 1.0),
    azimuth=0.0,
    altitude=0.3,
    lift=0.0,
    top_gain=1.4e-3,
    bottom_gain=1.4e-3,
    spin=0.0,
    spin_gain=0.0,
)
"""Rough initial guess of the fit."""
ALONE = np.array([0.05, 0.01, 0.01, 10.0, 10.0, 10.0])
"""Typical changes from shot to shot: speed [m/s], azimuth, altitude [rad], spin [rad/s]. The value
for the spin is also a prior, because a short flight says little about the spin."""
NOISE = 0.005
"""Noise of a recorded position [m]."""
SCATTERS = ("speed_scatter", "azimuth_scatter", "altitude_scatter", "spin_scatter")
LOW = 0.05
"""Rows before the first one below this height above the table precede the bounce [m]."""
PERIOD = 0.001
"""Period of the computed flights [s]."""
LEAD = 0.2
"""Longest time from the launch to the first row of a shot [s]."""
FIRST_ROWS = 10
"""Number of rows from which the time of the launch is estimated."""


def fitted(shots: Sequence[Shot], start: LaunchModel = START) -> LaunchModel:
    """Fits the model to shots. Raises InvalidArgument if their motor settings are too few."""
    speeds = np.array([shot.setting.speeds for shot in shots])
    faster = speeds[:, :2].mean(axis=1) - speeds[:, 2]  # the upper motors
    if np.ptp(faster) == 0.0 or np.linalg.matrix_rank(speeds @ [[1, 0], [1, 0], [0, 1]]) < 2:
        raise InvalidArgument(
            "the shots must have at least two settings of the motors, which differ in the speed of "
            "the upper ones relative to the lower one"
        )
    # a bounce slides or grips, which causes local minima: the first fit leaves it out
    before = [_before_bounce(shot) for shot in shots]
    return _improved(_improved(start, before, None), shots, TABLE)


def _before_bounce(shot: Shot) -> Shot:
    low = shot.positions[:, 2] < TABLE.middle[2] + LOW
    rows = int(np.argmax(low)) if low.any() else len(low)
    if rows < FIRST_ROWS:
        raise InvalidArgument(
            f"{shot.name}: only {rows} rows before the bounce; leave out this shot"
        )
    return replace(shot, stamps=shot.stamps[:rows], positions=shot.positions[:rows])


def _improved(start: LaunchModel, shots: Sequence[Shot], table: Table | None) -> LaunchModel:
    origin, scales = _numbers(start), np.array([*SCALES.values()])
    moves = _solved(lambda moves: _misses(_model(start, origin + moves), shots, table), scales)
    return _model(start, origin + moves)


def scatter(model: LaunchModel, shots: Sequence[Shot]) -> FloatArray:
    """Returns the standard deviations from shot to shot (4,), in the order of SCATTERS."""
    found = np.array([_solved(partial(_missed_alone, model, shot), ALONE) for shot in shots])
    spin = np.sqrt(found[:, 3:].var(axis=0).mean())
    return np.array([*found[:, :3].std(axis=0), spin])


def _missed_alone(model: LaunchModel, shot: Shot, moves: FloatArray) -> FloatArray:
    """Residuals in standard deviations, for a launch that differs from the mean by `moves`."""
    ball = model.launch(shot.setting.phi, shot.setting.theta, shot.setting.speeds)
    x, y, z = ball.velocity
    speed = float(np.linalg.norm(ball.velocity))
    azimuth = math.atan2(y, x) + moves.item(1)
    altitude = math.asin(z / speed) + moves.item(2)
    level = math.cos(altitude)
    ahead = [level * math.cos(azimuth), level * math.sin(azimuth), math.sin(altitude)]
    velocity = (speed + moves.item(0)) * np.array(ahead)
    moved = Launch(ball.position, velocity, ball.spin + moves[3:])
    missed = _missed(_flight(moved, LEAD + shot.stamps[-1]), shot).ravel()
    return np.concatenate([missed / NOISE, moves[3:] / ALONE[3:]])


def _solved(missed: Callable[[FloatArray], FloatArray], scales: FloatArray) -> FloatArray:
    """Returns the numbers (n,) with the least sum of squares of `missed`, starting from 0."""
    optimize = needed("scipy.optimize", "recordings", "the fit", package="o80-devices")
    found = optimize.least_squares(
        lambda shares: missed(scales * shares), np.zeros(len(scales)), method="lm"
    )
    numbers: FloatArray = scales * found.x
    return numbers


def halves(shots: Sequence[Shot]) -> tuple[list[Shot], list[Shot]]:
    """Splits the shots, in a fixed random order, into those to fit and those to test."""
    order = np.random.default_rng(0).permutation(len(shots))
    middle = (len(shots) + 1) // 2
    return [shots[i] for i in order[:middle]], [shots[i] for i in order[middle:]]


def distances(model: LaunchModel, shots: Sequence[Shot]) -> list[FloatArray]:
    """Distances of each shot's rows (N,) from the mean flight of the model [m]."""
    rows = np.linalg.norm(_misses(model, shots).reshape(-1, 3), axis=1)
    return np.split(rows, np.cumsum([len(shot.stamps) for shot in shots])[:-1])


def _numbers(model: LaunchModel) -> FloatArray:
    _, y, z = model.muzzle
    return np.array([y, z, *(getattr(model, name) for name in [*SCALES][2:])])


def _model(start: LaunchModel, numbers: FloatArray) -> LaunchModel:
    y, z, *others = (float(number) for number in numbers)
    values = dict(zip([*SCALES][2:], others, strict=True))
    return replace(start, muzzle=(start.muzzle[0], y, z), **values)


def _misses(model: LaunchModel, shots: Sequence[Shot], table: Table | None = TABLE) -> FloatArray:
    """Concatenates the differences of all shots, flight minus recorded position [m]."""
    flights: dict[Setting, FloatArray] = {}
    for setting in {shot.setting for shot in shots}:
        mine = [shot for shot in shots if shot.setting == setting]
        ball = model.launch(setting.phi, setting.theta, setting.speeds)
        flights[setting] = _flight(ball, LEAD + max(shot.stamps[-1] for shot in mine), table)
    return np.concatenate([_missed(flights[shot.setting], shot).ravel() for shot in shots])


def _flight(ball: Launch, duration: float, table: Table | None = TABLE) -> FloatArray:
    """Computes the flight of a ball: rows (K, 4) of time [s] and position [m]."""
    start = np.concatenate([ball.position, ball.velocity, ball.spin])
    return FlightLaw(Flight(), table).path(start, duration, PERIOD)[:, :4]


def _missed(flight: FloatArray, shot: Shot) -> FloatArray:
    """Returns flight minus position for each row (N, 3); the first rows give the launch time."""
    times, *axes = flight.T

    def at(moments: FloatArray) -> FloatArray:
        return np.stack([np.interp(moments, times, axis) for axis in axes], axis=1)

    lead = round(LEAD / PERIOD)
    first = shot.positions[:FIRST_ROWS]
    begin = float(np.interp(first[0, 0], axes[0][:lead], times[:lead]))
    since = shot.stamps[:FIRST_ROWS] + begin
    velocity = (at(since + PERIOD) - at(since)) / PERIOD
    begin += float(((first - at(since)) * velocity).sum() / (velocity**2).sum())
    missed: FloatArray = at(shot.stamps + begin) - shot.positions
    return missed


def main(arguments: Sequence[str] | None = None) -> None:
    """Runs the command line."""
    parser = argparse.ArgumentParser(
        prog="python -m o80_devices.ball_launcher.fit",
        description="Fits the launch model to recorded shots.",
    )
    parser.add_argument("paths", nargs="+", type=Path, help="files of HDF5, or folders of them")
    parser.add_argument("--all", action="store_true", help="fit all shots, and test none")
    given = parser.parse_args(arguments)
    try:
        shots = recorded_shots(given.paths)
        fit_on, test_on = (shots, []) if given.all else halves(shots)
        found = fitted(fit_on)
    except o80.Error as error:
        sys.exit(f"o80: {error}")
    print(f"fitted to {len(fit_on)} of {len(shots)} shots; beside it LAUNCH_MODEL")
    for name, number, present in zip(SCALES, _numbers(found), _numbers(LAUNCH_MODEL), strict=True):
        print(f"{name:16} {number:10.4g} {present:10.4g}")
    for name, number in zip(SCATTERS, scatter(found, shots), strict=True):
        print(f"{name:16} {number:10.4g} {getattr(LAUNCH_MODEL, name):10.4g}")
    if test_on:
        away = distances(found, test_on)
        mean, largest = np.mean([each.mean() for each in away]), max(each.max() for each in away)
        print(f"the other {len(test_on)} shots: {mean:.3f} m from it, at most {largest:.3f} m")


if __name__ == "__main__":
    open_standard_streams()
    main()
