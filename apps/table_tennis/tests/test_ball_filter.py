"""The filtered ball: nearer to the truth than what is measured, and alike for one and many."""

import numpy as np
import pytest
from numpy.typing import NDArray

from o80_table_tennis.balls.launches import WIDE
from o80_table_tennis.balls.simulated_shots import SimulatedShots
from o80_table_tennis.physics.ball_filter import ManyBallFilter, OneBallFilter
from o80_table_tennis.physics.filter_gains import FilterSettings
from o80_table_tennis.physics.prediction import predict, predict_crossing

FloatArray = NDArray[np.float64]
SETTINGS = FilterSettings()
SHOTS, STEPS, PLANE = 40, 75, 0.3
SIGMAS = np.repeat([SETTINGS.position, SETTINGS.velocity], 3)


class Flights:
    """Wide shots as they fly, and where they cross the plane."""

    def __init__(self) -> None:
        self.states, self.spins, self.crossings = [], [], []
        for number in range(SHOTS):
            launch = SimulatedShots(WIDE).launch(number)
            start = launch.position, launch.velocity
            flight = predict(*start, STEPS * 0.01, spin=launch.spin)
            self.states.append(np.hstack([flight.positions, flight.velocities]))
            self.spins.append(flight.spins[:, 0])
            crossing = predict_crossing(*start, axis=1, at=PLANE, spin=launch.spin)
            assert crossing is not None
            self.crossings.append([*crossing.position[[0, 2]], crossing.time])


@pytest.fixture(scope="module")
def flights() -> Flights:
    return Flights()


@pytest.fixture(scope="module")
def seen(flights: Flights) -> FloatArray:
    """Measurements (SHOTS, STEPS, 6)."""
    states = np.array(flights.states)[:, :STEPS]
    seen: FloatArray = states + np.random.default_rng(1).normal(size=states.shape) * SIGMAS
    return seen


def test_one_ball_and_many_get_the_same_bits(seen: FloatArray) -> None:
    missed = np.random.default_rng(2).random((SHOTS, STEPS)) < 0.1
    seen = seen.copy()
    seen[:5, 40:, 4] *= -1  # the racket meets some balls
    many = ManyBallFilter(SETTINGS, SHOTS)
    many.begin(slice(None), seen[:, 0].T)
    ones = [OneBallFilter(SETTINGS) for _ in range(SHOTS)]
    for one, rows in zip(ones, seen, strict=True):
        one.begin(rows[0].tolist())
    for step in range(1, STEPS):
        many.step(np.ascontiguousarray(seen[:, step].T), missed[:, step])
        for number, one in enumerate(ones):
            one.step(None if missed[number, step] else seen[number, step].tolist())
        np.testing.assert_array_equal(many.balls.T, [one.ball for one in ones])
        crossings = many.crossings(PLANE)
        alone = np.array([one.crossing(PLANE) for one in ones])
        assert np.ascontiguousarray(crossings.T).tobytes() == alone.tobytes()  # no -0 for a 0
        some = np.array([3, 17])
        np.testing.assert_array_equal(many.crossings(PLANE, some), crossings[:, some])


def test_a_new_flight_of_one_ball_leaves_the_others_alone(seen: FloatArray) -> None:
    filters = [ManyBallFilter(SETTINGS, SHOTS) for _ in range(2)]
    nothing = np.zeros(SHOTS, np.bool_)
    for each in filters:
        each.begin(slice(None), seen[:, 0].T)
    for step in range(1, 70):
        if step == 30:
            filters[1].begin(np.array([7]), seen[[7], 0].T)
        for each in filters:
            each.step(np.ascontiguousarray(seen[:, step].T), nothing)
    others = np.arange(SHOTS) != 7
    np.testing.assert_array_equal(filters[0].balls[:, others], filters[1].balls[:, others])
    assert not np.array_equal(filters[0].balls[:, 7], filters[1].balls[:, 7])


def test_the_estimate_is_much_nearer_than_what_is_measured(
    flights: Flights, seen: FloatArray
) -> None:
    many = ManyBallFilter(SETTINGS, SHOTS)
    many.begin(slice(None), seen[:, 0].T)
    nothing = np.zeros(SHOTS, np.bool_)
    for step in range(1, 51):
        many.step(np.ascontiguousarray(seen[:, step].T), nothing)
    off = many.balls[:6].T - np.array(flights.states)[:, 50]
    spins = many.balls[6] - np.array(flights.spins)[:, 50]
    times = np.array([0.0, 0.0, 0.5])
    crossings = many.crossings(PLANE)[[0, 1, 5]].T + times - np.array(flights.crossings)

    assert np.sqrt(np.mean(off[:, :3] ** 2)) < SETTINGS.position / 2
    assert np.sqrt(np.mean(off[:, 3:] ** 2)) < SETTINGS.velocity / 5
    assert np.sqrt(np.mean(spins**2)) < 10.0
    # a few shots bounce again just before the plane
    assert (np.percentile(np.abs(crossings), 80, axis=0) < [0.006, 0.01, 0.012]).all()


def test_a_velocity_that_no_flight_explains_begins_anew() -> None:
    each = OneBallFilter(SETTINGS)
    each.begin((0.5, 0.5, 1.1, 0.2, -3.0, 0.5))
    hit = (0.5, 0.45, 1.1, 0.3, 4.0, 1.5)
    each.step(hit)
    assert each.ball[:6] == hit
    assert each.crossing(PLANE) == (0.0,) * 6


def test_an_unseen_ball_flies_on_and_bounces_too() -> None:
    launch = SimulatedShots(WIDE).launch(4)
    each = OneBallFilter(SETTINGS)
    flight = predict(launch.position, launch.velocity, 0.7, spin=launch.spin)
    states = np.hstack([flight.positions, flight.velocities])
    each.begin(states[0].tolist())
    for row in states[1:50]:
        each.step(row.tolist())
    for _ in states[50:]:
        each.step(None)
    assert flight.bounce_times[0] > 0.5
    np.testing.assert_allclose(each.ball[:3], states[-1, :3], atol=0.03)
    np.testing.assert_allclose(each.ball[3:6], states[-1, 3:], atol=0.15)
