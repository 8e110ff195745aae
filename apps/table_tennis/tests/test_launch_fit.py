"""The distribution of the narrow shots: fitted to 40 recorded ones, tested on the other 40."""

import numpy as np
import pytest
from recorded_rows import ball_gun_shots

from launch_fit import (
    LAUNCH,
    NAMES,
    fitted,
    halves,
    probability_of_same,
    recorded_numbers,
    simulated_numbers,
)
from o80.base.arrays import FloatArray
from o80_table_tennis.balls.launches import NARROW
from o80_table_tennis.balls.simulated_shots import SimulatedShots

UNLIKELY = 0.001
"""The drawn sample is fixed: 18 comparisons rarely fall below this by chance."""
AFTER_BOUNCE = ("crossing time", "crossing vx", "crossing vy")
"""Numbers that the law of the bounce, which is fitted to all spins, does not quite get."""


@pytest.fixture(scope="module")
def recorded() -> FloatArray:
    return recorded_numbers(ball_gun_shots())


@pytest.fixture(scope="module")
def simulated() -> FloatArray:
    return simulated_numbers([SimulatedShots().launch(number) for number in range(300)])


@pytest.mark.recordings("ball_gun_2019")
def test_the_constants_are_those_of_the_fit(recorded: FloatArray) -> None:
    fit_on, test_on = halves(len(recorded))
    assert sorted([*fit_on, *test_on]) == list(range(80))
    mean, covariance = fitted(recorded[fit_on][:, LAUNCH])
    factor = np.zeros((9, 9))
    for number, row in enumerate(NARROW.factor):
        factor[number, : number + 1] = row
    np.testing.assert_allclose(NARROW.mean, mean, atol=0.01)
    deviations = np.sqrt(np.diag(covariance))
    off = (factor @ factor.T - covariance) / np.outer(deviations, deviations)
    assert np.abs(off).max() < 0.05


@pytest.mark.recordings("ball_gun_2019")
def test_simulated_shots_are_like_those_that_were_not_fitted(
    recorded: FloatArray, simulated: FloatArray
) -> None:
    unseen = recorded[halves(len(recorded))[1]]
    for number, name in enumerate(NAMES):
        if name not in AFTER_BOUNCE:
            p = probability_of_same(unseen[:, number], simulated[:, number])
            assert p > UNLIKELY, name
    means = dict(zip(NAMES, simulated.mean(axis=0) - unseen.mean(axis=0), strict=True))
    assert abs(means["crossing time"]) < 0.025
    assert abs(means["crossing vx"]) < 0.06
    assert abs(means["crossing vy"]) < 0.13


def test_samples_of_one_distribution_are_told_from_those_of_two() -> None:
    rng = np.random.default_rng(2)
    one, other = rng.normal(size=(2, 200))
    assert probability_of_same(one, one) == 1.0
    same = [probability_of_same(*rng.normal(size=(2, 100))) for _ in range(300)]
    assert 0.01 < np.mean(np.array(same) < 0.05) < 0.1
    assert probability_of_same(one, other + 0.6) < 1e-4
    assert probability_of_same(one, 2 * other) < 0.01
