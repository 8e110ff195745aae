"""Planned strikes send the ball to the target."""

import numpy as np
import pytest
from recorded_rows import simulated_shot

from o80_table_tennis.physics.impact import leaving
from o80_table_tennis.physics.prediction import predict
from o80_table_tennis.players.interception import (
    TOUCH,
    InterceptionSettings,
    StrikePlanner,
    coming_ball,
)
from o80_table_tennis.world.arm import racket_pose

NARROW = 0.074  # from the middle of the blade to its nearest rim [m]


@pytest.mark.parametrize("seed", range(8))
def test_a_planned_strike_sends_the_ball_to_the_target(seed: int) -> None:
    settings = InterceptionSettings()
    shot = simulated_shot(np.random.default_rng(seed))
    row = int(np.argmax(shot.positions[:, 1] < 2.0))
    ball = coming_ball(shot.positions[row], shot.velocities[row], settings)
    assert ball is not None
    strike = StrikePlanner(settings).plan(ball)
    assert strike is not None

    # the racket's face touches the ball, and turns it round
    position, velocity = ball.at(strike.time)
    pose = racket_pose(strike.posture)
    normal = np.array(pose.normal)
    offset = position - np.array(pose.position)
    assert offset @ normal == pytest.approx(TOUCH, abs=0.002)
    assert np.linalg.norm(offset - TOUCH * normal) < NARROW
    racket = np.cross([0.0, 0.0, strike.speeds[0]], pose.position)
    outgoing = leaving(velocity, ball.spin, racket, normal)
    flight = position, outgoing.velocity
    time = predict(*flight, 1.5, spin=outgoing.spin).bounce_times[0]
    landing = predict(*flight, time, spin=outgoing.spin, period=time).positions[-1]
    assert landing[:2] == pytest.approx((0.0, 2.5), abs=0.1)


@pytest.mark.parametrize(("y", "speed"), [(1.0, 3.0), (-0.5, -3.0)])
def test_a_ball_that_flies_away_or_is_behind_the_arm_is_left_alone(y: float, speed: float) -> None:
    place, velocity = np.array([0.5, y, 1.2]), np.array([0.2, speed, 0.5])
    assert coming_ball(place, velocity, InterceptionSettings()) is None
