"""The launch model: what angles and motors do to a ball."""

import math

import numpy as np
import pytest

from o80_devices.ball_launcher import LAUNCH_MODEL
from o80_devices.ball_launcher.wheel_speeds import actuation_of, speed_of

EQUAL = (1200.0, 1200.0, 1200.0)


def test_faster_wheels_throw_faster() -> None:
    speeds = [
        float(np.linalg.norm(LAUNCH_MODEL.launch(0.5, 0.5, (rpm, rpm, rpm)).velocity))
        for rpm in (0.0, 600.0, 1200.0)
    ]
    assert speeds[0] == 0.0
    assert speeds[2] == pytest.approx(2 * speeds[1])


def test_angles_turn_the_ball_to_the_left_and_up() -> None:
    middle = LAUNCH_MODEL.launch(0.5, 0.5, EQUAL).velocity
    assert LAUNCH_MODEL.launch(0.6, 0.5, EQUAL).velocity[1] > middle[1]
    assert LAUNCH_MODEL.launch(0.5, 0.6, EQUAL).velocity[2] > middle[2]


def test_faster_upper_wheels_give_top_spin_and_a_faster_right_wheel_turns_it_to_the_left() -> None:
    plain = LAUNCH_MODEL.launch(0.5, 0.5, EQUAL).spin
    assert LAUNCH_MODEL.launch(0.5, 0.5, (1800.0, 1800.0, 400.0)).spin[1] > plain[1]
    assert LAUNCH_MODEL.launch(0.5, 0.5, (1100.0, 1300.0, 1200.0)).spin[2] > plain[2]


def test_the_scatter_is_repeated_by_its_seed() -> None:
    shots = [
        LAUNCH_MODEL.launch(0.5, 0.5, EQUAL, np.random.default_rng(seed)) for seed in (1, 1, 2)
    ]
    np.testing.assert_array_equal(shots[0].velocity, shots[1].velocity)
    assert not np.array_equal(shots[0].velocity, shots[2].velocity)


def test_a_ball_is_placed_in_a_world() -> None:
    ball = LAUNCH_MODEL.launch(0.5, 0.5, EQUAL)
    placed = ball.placed((1.0, 2.0, 3.0), math.pi / 2)
    assert placed.velocity[1] == pytest.approx(ball.velocity[0])
    assert placed.spin[0] == pytest.approx(-ball.spin[1])
    np.testing.assert_allclose(placed.position[2], ball.position[2] + 3.0)


@pytest.mark.parametrize("actuation", [0.3, 0.45, 1.0])
def test_speeds_of_motors_and_actuations_belong_together(actuation: float) -> None:
    assert actuation_of(speed_of(actuation)) == pytest.approx(actuation)


def test_a_speed_that_no_motor_reaches_is_refused() -> None:
    with pytest.raises(ValueError, match="between 0 and 3970"):
        actuation_of(5000.0)
