"""The laws for estimates: as those of other modules, and the same bits for one ball and many."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from o80_table_tennis.balls.launches import WIDE
from o80_table_tennis.balls.simulated_shots import SimulatedShots
from o80_table_tennis.physics.impact import bounced
from o80_table_tennis.physics.prediction import predict, predict_crossing, predict_landing
from o80_table_tennis.physics.tracked_ball import (
    ARRAYS,
    NUMBERS,
    Ball,
    advanced,
    at_plane,
    at_table,
    rebounded,
    rebounded_within,
)
from o80_table_tennis.world.table import TABLE

FloatArray = NDArray[np.float64]
SHOTS = SimulatedShots(WIDE)
STEP = 0.01


def launched(number: int) -> Ball:
    launch = SHOTS.launch(number)
    return (*launch.position.tolist(), *launch.velocity.tolist(), float(launch.spin[0]))


def later(ball: Ball, time: float) -> Ball:
    """By the prediction that others use."""
    flight = predict(ball[:3], ball[3:6], time, spin=(ball[6], 0.0, 0.0), period=time)
    row = (*flight.positions[-1], *flight.velocities[-1], flight.spins[-1, 0])
    return tuple(float(number) for number in row)


def test_a_step_of_flight_is_that_of_the_prediction() -> None:
    for number in range(20):
        ball = launched(number)
        found = np.array(advanced(ball, STEP, NUMBERS))
        np.testing.assert_allclose(found[:6], later(ball, STEP)[:6], rtol=0, atol=2e-4)
        assert found[6] == pytest.approx(later(ball, STEP)[6], rel=1e-4)


@pytest.mark.parametrize("spin", [-300.0, -60.0, 0.0, 90.0, 400.0])
def test_a_bounce_is_that_of_the_law(spin: float) -> None:
    state = (0.5, 0.9, TABLE.bounce_height, 0.4, -3.8, -3.5)
    after, spins = bounced(state, (spin, 0.0, 0.0))
    np.testing.assert_allclose(rebounded((*state, spin), NUMBERS), [*after, spins[0]], atol=1e-7)


def test_a_touch_within_a_step_is_that_of_the_prediction() -> None:
    for number in range(20):
        ball = launched(number)
        touch = predict_landing(ball[:3], ball[3:6], spin=(ball[6], 0.0, 0.0))
        assert touch is not None
        ball = later(ball, touch.time - 0.004)
        found = rebounded_within(STEP, advanced(ball, STEP, NUMBERS), NUMBERS)
        # side spin, which a bounce makes of a slant, is left out of estimates
        np.testing.assert_allclose(found[:6], later(ball, STEP)[:6], rtol=0, atol=0.02)


def test_a_crossing_is_near_the_predicted_one() -> None:
    off = []
    for number in range(60):
        ball = later(launched(number), 0.2)
        true = predict_crossing(ball[:3], ball[3:6], axis=1, at=0.3, spin=(ball[6], 0.0, 0.0))
        assert true is not None
        ball, time = at_table(ball, NUMBERS)
        x, z, vx, vy, vz, more = at_plane(ball, 0.3, NUMBERS)
        miss = [x, z, vx, vy, vz, time + more] - np.array(
            [*true.position[[0, 2]], *true.velocity, true.time]
        )
        off.append(miss)
    # a few shots bounce again just before the plane
    assert (np.percentile(np.abs(off), 90, axis=0) < [0.004, 0.01, 0.02, 0.04, 0.08, 0.005]).all()


@pytest.mark.parametrize("spin", [-5000.0, 5000.0])
def test_an_absurd_estimate_is_a_number_all_the_same(spin: float) -> None:
    ball = (0.4, 2.0, 2.5, 1.0, -25.0, 8.0, spin)
    assert np.isfinite([*at_table(ball, NUMBERS)[0], *at_plane(ball, 0.3, NUMBERS)]).all()


def columns(balls: list[Ball]) -> tuple[FloatArray, ...]:
    return tuple(np.array(balls).T)


@pytest.mark.parametrize(
    "move",
    [
        lambda ball, maths: advanced(ball, STEP, maths),
        rebounded,
        lambda ball, maths: rebounded_within(STEP, ball, maths),
        lambda ball, maths: at_table(ball, maths)[0],
        lambda ball, maths: at_plane(ball, 0.3, maths),
    ],
)
def test_one_ball_and_many_get_the_same_bits(move: Any) -> None:
    balls = [launched(number) for number in range(50)]
    many = np.array(move(columns(balls), ARRAYS)).T
    one = np.array([move(ball, NUMBERS) for ball in balls])
    np.testing.assert_array_equal(many, one)
