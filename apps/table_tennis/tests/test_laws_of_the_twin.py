"""Flight, rebound and impact of predictions are those of the twins, number by number.

Both call the same law. Its numbers (air, restitutions, radius) are the application's: predictions
get them in calls, the twins as options.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from o80_mujoco.balls import path
from o80_table_tennis.balls.sampled_flight import SampledFlight
from o80_table_tennis.balls.simulated_shots import SimulatedShots
from o80_table_tennis.environment import TableTennisEnvironment
from o80_table_tennis.physics.aerodynamics import AERODYNAMICS
from o80_table_tennis.physics.impact import bounced, leaving
from o80_table_tennis.players.policies import default_policy
from o80_table_tennis.settings import TaskSettings
from o80_table_tennis.task.actions import COARSE
from o80_table_tennis.world.table import TABLE
from o80_table_tennis.world.timing import PERIOD

START = (0.3, 2.6, 1.3)
VELOCITY = (0.5, -4.0, 1.0)
SPIN = (80.0, -40.0, 30.0)
SMALL = 1e-12  # what the order of the terms may change [m, m/s]
ROWS = 250

Numbers = NDArray[np.float64]


@pytest.fixture(scope="module")
def flown() -> Iterator[Numbers]:
    """Position, velocity and spin (ROWS, 9) of a ball that a twin lets fly after its first row."""
    start = SampledFlight(
        "start",
        PERIOD,
        np.array([START]),
        np.array([VELOCITY]),
        np.empty(0),
        np.zeros(1),
        spins=np.array([SPIN]),
    )
    with TableTennisEnvironment() as environment:
        environment.reset(seed=1, options={"flight": start})
        (twin,) = environment.twins
        twin.burst(ROWS - 1)
        rows = twin.history(ROWS).observed.balls
        yield np.hstack([rows[name][:, 0] for name in ("position", "velocity", "spin")])


def later(row: Numbers, duration: float) -> Numbers:
    """A row of a free flight, `duration` [s] later."""
    row_later: Numbers = path(row[None], duration, 1, AERODYNAMICS.air)[1, 0]
    return row_later


def bounce_row(flown: Numbers) -> int:
    """The last row before the ball meets the table."""
    return int(np.argmax(np.diff(flown[:, 5]) > 1.0))


def test_a_ball_flies_alike(flown: Numbers) -> None:
    bounce = bounce_row(flown)
    assert 100 < bounce < ROWS - 10
    for number in range(bounce):
        expected = later(flown[number], PERIOD)
        np.testing.assert_allclose(flown[number + 1], expected, rtol=0, atol=SMALL)


def test_a_ball_leaves_the_table_alike(flown: Numbers) -> None:
    number = bounce_row(flown)
    row, end = flown[number], later(flown[number], PERIOD)
    # within a step the twin takes the way to the table as straight
    share = (row[2] - TABLE.bounce_height) / (row[2] - end[2])
    touching = row + share * (end - row)
    velocity, spin = bounced(touching[3:6], touching[6:])
    after = np.concatenate([touching[:3], velocity, spin])
    assert after[2] == pytest.approx(TABLE.bounce_height)

    rest = (1 - share) * PERIOD
    expected = later(after, rest)
    np.testing.assert_allclose(flown[number + 1, :6], expected[:6], rtol=0, atol=1e-7)
    np.testing.assert_allclose(flown[number + 1, 6:], expected[6:], rtol=0, atol=1e-4)
    assert np.linalg.norm(spin - np.array(SPIN)) > 50


def test_a_ball_leaves_the_racket_alike() -> None:
    policy, task = default_policy(), TaskSettings(factor=COARSE)
    with TableTennisEnvironment(task=task) as environment:
        flight = SimulatedShots().launch(1).seen().resample()
        observation, info = environment.reset(seed=1, options={"flight": flight})
        while not info["touched"]:
            observation, *_, info = environment.step(policy.act(observation))
        record: Any = environment.task.rows.records[0]["racket"]
        # the spin before the touch is the one that was imposed in that iteration
        history = environment.twins[0].history(5)
        clock = np.array(history.extended.clock)
        row = int(np.flatnonzero(clock == record["iteration"])[0])
        before = np.array(history.desired.balls["spin"][row, 0])
        after = leaving(
            record["velocity_before"],
            before,
            record["surface_velocity"],
            record["normal"],
        )
        np.testing.assert_allclose(record["velocity_after"], after.velocity, rtol=0, atol=SMALL)
        seen = np.array(history.observed.balls["spin"][row, 0])
        np.testing.assert_allclose(seen, after.spin, rtol=2e-3)  # it decays within the iteration
        assert np.linalg.norm(record["surface_velocity"]) > 0.5
