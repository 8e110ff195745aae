"""Shots of the ball launcher: its model is fitted to half of the recorded ones."""

import numpy as np
import pytest
from numpy.typing import NDArray
from recorded_rows import DATA

from o80_table_tennis.balls.launcher_shots import SETTINGS, launcher_launch
from o80_table_tennis.balls.playable import Verdict, verdict
from o80_table_tennis.balls.recordings import load_trajectories
from o80_table_tennis.balls.simulated_shots import DISTRIBUTIONS, SimulatedShots
from o80_table_tennis.balls.trajectories import BallTrajectory
from o80_table_tennis.physics.prediction import predict

FITTED = 13
"""Number of the 25 shots that were fitted, in an order drawn once and for all."""


def held_out() -> list[tuple[tuple[float, float, float], BallTrajectory]]:
    """The shots that were not fitted, each with its motors."""
    names = ("mn5008_no_spin", "mn5008_topspin")
    shots = [
        (speeds, shot)
        for name, speeds in zip(names, SETTINGS, strict=True)
        for shot in load_trajectories(DATA / "spin_2022" / f"{name}.hdf5")
    ]
    order = np.random.default_rng(0).permutation(len(shots))
    return [shots[index] for index in order[FITTED:]]


def distances(speeds: tuple[float, float, float], shot: BallTrajectory) -> NDArray[np.float64]:
    """Distances of each row from the flight of the mean ball [m]. Only the time of the launch,
    which was not recorded, is taken from the first rows."""
    launch = launcher_launch(speeds)
    flight = predict(launch.position, launch.velocity, 1.2, spin=launch.spin, period=0.001)

    def at(times: NDArray[np.float64]) -> NDArray[np.float64]:
        columns = [np.interp(times, flight.stamps, flight.positions[:, i]) for i in range(3)]
        return np.stack(columns, axis=1)

    since = shot.stamps - shot.stamps[0]
    begin = np.interp(-shot.positions[0, 1], -flight.positions[:200, 1], flight.stamps[:200])
    first = since[:10] + begin
    speed = (at(first + 0.001) - at(first)) / 0.001
    begin += ((shot.positions[:10] - at(first)) * speed).sum() / (speed**2).sum()
    away: NDArray[np.float64] = np.linalg.norm(at(since + begin) - shot.positions, axis=1)
    return away


@pytest.mark.recordings("spin_2022")
def test_shots_that_were_not_fitted_fly_within_ten_centimetres_of_the_model() -> None:
    shots = held_out()
    assert len(shots) == 12
    away = [distances(speeds, shot) for speeds, shot in shots]
    assert max(each[:180].max() for each in away) < 0.1
    assert np.mean([each.mean() for each in away]) < 0.03


def test_shots_of_the_launcher_are_one_of_the_distributions_and_can_be_played() -> None:
    shots = SimulatedShots(DISTRIBUTIONS["launcher"], seed=1)
    launches = [shots.launch(number) for number in range(50)]
    assert all(verdict(launch) is Verdict.PLAYABLE for launch in launches)
    assert launches[3].velocity.tolist() == shots.launch(3).velocity.tolist()
    assert np.std([launch.spin[0] for launch in launches]) > 10.0
