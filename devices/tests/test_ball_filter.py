"""The filter of a flying ball."""

import numpy as np
import pytest

from o80_devices.ball_tracking import four_cameras
from o80_devices.ball_tracking.ball_filter import GATE, BallFilter
from o80_devices.cameras.flight import Flight, FlightLaw, Table

FRAME = 1 / 180
LAW = four_cameras().law()
EXACT = 0.001**2 * np.eye(3)


def test_it_learns_velocity_and_spin_of_a_flight_with_a_bounce() -> None:
    ball = np.array([0.5, 3.0, 1.1, 0.2, -4.2, 1.6, -50, 0, 0])
    estimate = BallFilter(LAW)
    estimate.begin(ball[:3], EXACT)
    off, bounces = [], 0
    for _ in range(149):
        ball, bounced = LAW.advance(ball, FRAME)
        bounces += bounced
        estimate.predict(FRAME)
        estimate.update(ball[:3], EXACT)
        off.append(np.linalg.norm(estimate.ball[3:6] - ball[3:6]))
    assert bounces == 1
    assert max(off[30:]) < 0.4  # at the bounce itself
    assert off[-1] < 0.03
    assert estimate.ball[6] == pytest.approx(ball[6], abs=10)


def test_it_follows_a_ball_that_bounces_otherwise_than_by_the_law() -> None:
    ball = np.array([0.5, 3.0, 1.1, 0.2, -4.2, 1.6, 0, 0, 0])
    other = FlightLaw(Flight(), Table(kept_normal=0.7, kept_tangential=0.4))
    estimate = BallFilter(LAW)
    estimate.begin(ball[:3], EXACT)
    for _ in range(149):
        ball, _ = other.advance(ball, FRAME)
        estimate.predict(FRAME)
        assert estimate.distance(ball[:3], EXACT) < GATE
        estimate.update(ball[:3], EXACT)


def test_a_bounce_just_after_the_predicted_time_gives_no_wild_covariance() -> None:
    ball = np.array([0.4, 1.5, 1.0, 0, 0, -4.0, 0, 0, 0])
    ball[2] += Table().middle[2] + Flight().radius + 2e-6 - LAW.advance(ball, FRAME)[0][2]
    estimate = BallFilter(LAW)
    estimate.begin(ball[:3], EXACT, ball[3:6], 1.0)
    estimate.predict(FRAME)
    assert np.diag(estimate.covariance)[3:6].max() < 2.0


def test_its_covariance_stays_symmetric_and_positive() -> None:
    estimate = BallFilter(LAW)
    estimate.begin(np.array([0.4, 2.6, 1.1]), 9 * EXACT)
    for i in range(400):
        estimate.predict(FRAME)
        if i % 3 == 0:
            estimate.update(estimate.ball[:3], 9 * EXACT)
        covariance = estimate.covariance
        scale = np.sqrt(np.outer(np.diag(covariance), np.diag(covariance)))
        assert np.abs(covariance - covariance.T).max() < 1e-9 * scale.max()
        assert np.linalg.eigvalsh(covariance / scale).min() > 0


def test_a_distance_is_in_standard_deviations() -> None:
    estimate = BallFilter(LAW)
    estimate.begin(np.array([0.0, 0.0, 1.0]), 9 * EXACT)
    assert estimate.distance(np.array([0.01, 0.0, 1.0]), 16 * EXACT) == pytest.approx(4)
