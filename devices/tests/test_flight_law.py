"""The ball of the tracker flies and bounces as that of the table-tennis application."""

import numpy as np
import pytest

from o80_devices.ball_tracking import four_cameras
from o80_table_tennis.physics.prediction import predict
from o80_table_tennis.world.table import TABLE


@pytest.mark.parametrize("seed", range(12))
def test_the_tracker_and_the_application_predict_the_same_flight(seed: int) -> None:
    random = np.random.default_rng(seed)
    middle = np.array([TABLE.centre[0], TABLE.centre[1], TABLE.top])
    place = middle + random.uniform([-0.3, 0.5, 0.2], [0.3, 1.3, 0.5])
    velocity = random.uniform([-1, -6, -1], [1, -3, 2])
    spin = random.uniform(-150, 150, 3)
    predicted = predict(place, velocity, 0.8, spin=spin)
    ball, bounces = four_cameras().law().advance(np.concatenate([place, velocity, spin]), 0.8)
    assert bounces == len(predicted.bounce_times)
    assert np.linalg.norm(ball[:3] - predicted.positions[-1]) < 1e-3
    assert np.linalg.norm(ball[3:6] - predicted.velocities[-1]) < 1e-2
    assert np.linalg.norm(ball[6:] - predicted.spins[-1]) < 0.5
