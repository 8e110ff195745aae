"""The law of flight and bounce of the tracker is that of the table-tennis application."""

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
    law = four_cameras().law()
    predicted = predict(place.tolist(), velocity.tolist(), 0.8, spin=tuple(spin.tolist()))

    bounces = 0
    for time, position, speed, turn in zip(
        predicted.stamps,
        predicted.positions,
        predicted.velocities,
        predicted.spins,
        strict=True,
    ):
        ours = law.advance(place, velocity, spin, float(time))
        bounces = ours[3]
        if bounces and np.abs(time - predicted.bounce_times).min() < 0.002:
            continue  # the bounce itself lies between
        assert np.linalg.norm(ours[0] - position) < 1e-3
        assert np.linalg.norm(ours[1] - speed) < 1e-2
        assert np.linalg.norm(ours[2] - turn) < 0.5
    assert bounces == len(predicted.bounce_times)
