"""Flight, rebound and impact in Python are those of the twins in C++, number by number.

Python needs the laws for fits and predictions, the simulator for what happens. The numbers in them
(air, restitutions, radius) are the application's and go to the twins as options.
"""

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from o80_table_tennis.balls.sampled_flight import SampledFlight
from o80_table_tennis.environment import TableTennisEnvironment
from o80_table_tennis.physics.aerodynamics import AERODYNAMICS, State, runge_kutta_step
from o80_table_tennis.physics.impact import bounced, outgoing_velocity
from o80_table_tennis.players.policies import default_policy
from o80_table_tennis.rig.rig import Rig
from o80_table_tennis.settings import RigSettings, TaskSettings
from o80_table_tennis.task.actions import COARSE
from o80_table_tennis.world.ball import BALL_GUN_SPIN
from o80_table_tennis.world.materials import RACKET_RESTITUTION
from o80_table_tennis.world.table import TABLE
from o80_table_tennis.world.timing import PERIOD

START = (0.3, 2.6, 1.3)
VELOCITY = (0.5, -4.0, 1.0)
SMALL = 1e-12  # what the order of the terms may change [m, m/s]
ROWS = 250

Numbers = NDArray[np.float64]


@pytest.fixture(scope="module")
def flown() -> Iterator[Numbers]:
    """Position and velocity (ROWS, 6) of a ball that a twin lets fly after its first row."""
    start = SampledFlight(
        "start", PERIOD, np.array([START]), np.array([VELOCITY]), np.empty(0), np.zeros(1)
    )
    with Rig(RigSettings()) as rig:
        rig.reset(arm_seed=1, twin_seed=1, flights=[[start]])
        twin = rig.twins[0].frontend
        twin.burst(ROWS - 1)
        rows = twin.history(ROWS).observed.balls
        yield np.hstack([rows["position"][:, 0], rows["velocity"][:, 0]])


def later(row: Numbers, number: int, duration: float) -> State[float]:
    """Row `number` of a free flight, `duration` [s] later, with the spin of the middle."""
    now = number * PERIOD + duration / 2
    share = AERODYNAMICS.magnus * math.exp(-AERODYNAMICS.spin_decay * now)
    wx, wy, wz = BALL_GUN_SPIN
    turn = (share * wx, share * wy, share * wz)
    x, y, z, vx, vy, vz = row.tolist()
    state = (x, y, z, vx, vy, vz)
    return runge_kutta_step(state, turn, AERODYNAMICS.drag, AERODYNAMICS.gravity, duration)


def bounce_row(flown: Numbers) -> int:
    """The last row before the ball meets the table."""
    return int(np.argmax(np.diff(flown[:, 5]) > 1.0))


def test_a_ball_flies_alike(flown: Numbers) -> None:
    bounce = bounce_row(flown)
    assert 100 < bounce < ROWS - 10
    for number in range(bounce):
        expected = later(flown[number], number, PERIOD)
        np.testing.assert_allclose(flown[number + 1], expected, rtol=0, atol=SMALL)


def test_a_ball_leaves_the_table_alike(flown: Numbers) -> None:
    number = bounce_row(flown)
    row, end = flown[number], np.array(later(flown[number], number, PERIOD))
    # within a step the twin takes the way to the table as straight
    share = (row[2] - TABLE.bounce_height) / (row[2] - end[2])
    touching = row + share * (end - row)
    x, y, z, vx, vy, vz = touching.tolist()
    after = np.array(bounced((x, y, z, vx, vy, vz)))
    assert after[2] == pytest.approx(TABLE.bounce_height)

    rest = (1 - share) * PERIOD
    expected = later(after, number + share, rest)
    np.testing.assert_allclose(flown[number + 1], expected, rtol=0, atol=1e-7)


def test_a_ball_leaves_the_racket_alike() -> None:
    policy, task = default_policy(), TaskSettings(factor=COARSE)
    with TableTennisEnvironment(task=task) as environment:
        observation, info = environment.reset(seed=1)
        while not info["hit"]:
            observation, *_, info = environment.step(policy.act(observation))
        record: Any = environment.rig.twins[0].all_records[0]["racket"]
        expected = outgoing_velocity(
            record["velocity_before"],
            record["surface_velocity"],
            record["normal"],
            RACKET_RESTITUTION,
        )
        np.testing.assert_allclose(record["velocity_after"], expected, rtol=0, atol=SMALL)
        assert np.linalg.norm(record["surface_velocity"]) > 0.5
