"""The filtered ball: nearer to the truth than what is measured, and alike for one and many."""

from dataclasses import replace

import numpy as np
import pytest
from recorded_rows import crossing

from o80.base.arrays import FloatArray
from o80_table_tennis.balls.launches import WIDE
from o80_table_tennis.balls.simulated_shots import SimulatedShots
from o80_table_tennis.physics.ball_filter import PLACES, FilterSettings, ball_filter, gains
from o80_table_tennis.physics.prediction import predict
from o80_table_tennis.world.table import TABLE

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
            time, place, _ = crossing(*start, axis=1, at=PLANE, spin=launch.spin)
            self.crossings.append([*place[[0, 2]], time])


@pytest.fixture(scope="module")
def flights() -> Flights:
    return Flights()


@pytest.fixture(scope="module")
def seen(flights: Flights) -> FloatArray:
    """Measurements (SHOTS, STEPS, 6)."""
    states = np.array(flights.states)[:, :STEPS]
    seen: FloatArray = states + np.random.default_rng(1).normal(size=states.shape) * SIGMAS
    return seen


def test_the_estimate_is_much_nearer_than_what_is_measured(
    flights: Flights, seen: FloatArray
) -> None:
    many = ball_filter(SETTINGS, SHOTS)
    many.begin(seen[:, 0])
    nothing = np.zeros(SHOTS, np.bool_)
    for step in range(1, 51):
        many.step(seen[:, step], nothing)
    found = many.estimates(PLANE)
    off = found[:, :6] - np.array(flights.states)[:, 50]
    spins = found[:, 6] - np.array(flights.spins)[:, 50]
    times = np.array([0.0, 0.0, 0.5])
    crossings = found[:, [7, 8, 12]] + times - np.array(flights.crossings)

    assert np.sqrt(np.mean(off[:, :3] ** 2)) < SETTINGS.position / 2
    assert np.sqrt(np.mean(off[:, 3:] ** 2)) < SETTINGS.velocity / 5
    assert np.sqrt(np.mean(spins**2)) < 10.0
    # a few shots bounce again just before the plane
    assert (np.percentile(np.abs(crossings), 80, axis=0) < [0.006, 0.01, 0.012]).all()


def test_a_velocity_that_no_flight_explains_begins_anew() -> None:
    each = ball_filter(SETTINGS, 1)
    each.begin(np.array([[0.5, 0.5, 1.1, 0.2, -3.0, 0.5]]))
    hit = np.array([[0.5, 0.45, 1.1, 0.3, 4.0, 1.5]])
    each.step(hit, np.zeros(1, np.bool_))
    found = each.estimates(PLANE)[0]
    np.testing.assert_array_equal(found[:6], hit[0])
    assert found[6] == SETTINGS.mean_spin
    np.testing.assert_array_equal(found[7:], 0.0)


def test_an_unseen_ball_flies_on_and_bounces_too() -> None:
    launch = SimulatedShots(WIDE).launch(4)
    each = ball_filter(SETTINGS, 1)
    flight = predict(launch.position, launch.velocity, 0.7, spin=launch.spin)
    states = np.hstack([flight.positions, flight.velocities])
    each.begin(states[:1])
    for row in states[1:50]:
        each.step(row[None], np.array([False]))
    for row in states[50:]:
        each.step(0 * row[None], np.array([True]))
    assert flight.bounce_times[0] > 0.5
    found = each.estimates(PLANE)[0]
    np.testing.assert_allclose(found[:3], states[-1, :3], atol=0.03)
    np.testing.assert_allclose(found[3:6], states[-1, 3:], atol=0.15)


def test_the_first_measurement_after_an_unseen_bounce_gets_the_first_gain() -> None:
    falling = np.array([[0.5, 0.9, TABLE.bounce_height + 0.01, 0.2, -3.0, -3.0]])
    higher = np.array([[0.0, 0.0, 0.01, 0.0, 0.0, 0.0]])
    found = []
    for seen_higher in (0.0, 1.0):
        each = ball_filter(SETTINGS, 1)
        each.begin(falling)
        each.step(falling, np.array([True]))
        assert each.estimates(PLANE)[0, 5] > 0.0
        each.step(each.estimates(PLANE)[:, :6] + seen_higher * higher, np.array([False]))
        found.append(each.estimates(PLANE)[0, 2])
    gain = gains(SETTINGS).after[0][PLACES.index((2, 2))]
    assert (found[1] - found[0]) / 0.01 == pytest.approx(gain, rel=1e-9)


def test_a_crossing_is_that_of_the_predicted_flight() -> None:
    each, off = ball_filter(SETTINGS, 1), []
    spin = (SETTINGS.mean_spin, 0.0, 0.0)
    for number in range(60):
        launch = SimulatedShots(WIDE).launch(number)
        flight = predict(launch.position, launch.velocity, 0.21, spin=spin)
        state = np.concatenate([flight.positions[20], flight.velocities[20]])
        time, place, way = crossing(state[:3], state[3:], axis=1, at=PLANE, spin=spin)
        each.begin(state[None])
        expected = [*place[[0, 2]], *way, time]
        off.append(each.estimates(PLANE)[0, 7:] - expected)
    # side spin, which a slanted bounce makes, is left out; a few bounce again before the plane
    most = [0.004, 0.002, 0.02, 0.01, 0.03, 0.001]
    assert (np.percentile(np.abs(off), 90, axis=0) < most).all()


@pytest.mark.parametrize("spin", [-20000.0, 0.0, 5000.0])
def test_an_absurd_estimate_is_a_number_all_the_same(spin: float) -> None:
    each = ball_filter(replace(SETTINGS, mean_spin=spin), 2000)
    spread = [3.0, 3.0, 3.0, 20.0, 20.0, 20.0]
    each.begin(np.random.default_rng(0).normal(size=(2000, 6)) * spread)
    assert np.isfinite(each.estimates(PLANE)).all()
