"""Predicted flights bounce as the table does."""

import math

import numpy as np
import pytest

from o80_table_tennis.physics.prediction import predict
from o80_table_tennis.world.table import Table

START = (0.46, 2.95, 1.37)
VELOCITY = (0.24, -4.14, 2.28)


def test_a_bounce_without_spin_keeps_the_named_shares_of_the_velocity() -> None:
    table = Table(normal_restitution=0.9, tangential_restitution=0.6, friction=math.inf)
    (time,) = predict(START, VELOCITY, 1.0, table=table).bounce_times
    before, after = (
        predict(START, VELOCITY, time + off, period=time + off, table=table)
        for off in (-1e-6, 1e-6)
    )

    assert before.positions[-1, 2] == pytest.approx(0.795, abs=1e-5)
    expected = before.velocities[-1] * np.array([0.6, 0.6, -0.9])
    np.testing.assert_allclose(after.velocities[-1], expected, atol=1e-4)


@pytest.mark.parametrize("bad", [0.0, -1.0, math.nan, math.inf])
def test_a_duration_that_is_none_is_refused(bad: float) -> None:
    with pytest.raises(ValueError, match="duration"):
        predict(START, VELOCITY, bad)


def test_a_start_that_is_not_finite_is_refused() -> None:
    with pytest.raises(ValueError, match="finite"):
        predict((0.0, math.nan, 0.0), VELOCITY, 1.0)
