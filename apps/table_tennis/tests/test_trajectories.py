"""A ball as it was seen, and its resampling."""

import numpy as np
import pytest
from recorded_rows import simulated_shot

from o80_table_tennis.balls.trajectories import BallTrajectory


def test_a_trajectory_whose_arrays_do_not_fit_is_refused() -> None:
    stamps, rows = np.linspace(0.0, 0.1, 20), np.zeros((20, 3))
    broken = rows.copy()
    broken[3, 1] = np.nan
    for arguments, message in (
        ((stamps[:19], rows, rows), "positions have shape"),
        ((stamps, rows, broken), r"velocities hold NaN.*row 3"),
        ((stamps[::-1], rows, rows), "do not rise from row 0"),
    ):
        with pytest.raises(ValueError, match=message) as raised:
            BallTrajectory("shot 7", *arguments)
        assert "shot 7" in str(raised.value)


def test_a_trajectory_too_short_to_fit_is_refused_when_sampled() -> None:
    short = BallTrajectory("shot 7", np.arange(4.0), np.zeros((4, 3)), np.zeros((4, 3)))

    with pytest.raises(ValueError, match="shot 7: 4 rows are too few"):
        short.resample()


def test_the_sampled_flight_is_smooth_except_for_its_bounce() -> None:
    shot = simulated_shot(np.random.default_rng(2))
    sampled = shot.resample(0.002)

    # each step is the mean of its two velocities, but for the one that holds the bounce
    steps = np.diff(sampled.positions, axis=0) / sampled.period
    means = (sampled.velocities[1:] + sampled.velocities[:-1]) / 2
    off = np.linalg.norm(steps - means, axis=1)
    bounce = int(sampled.bounce_times[0] / sampled.period)
    assert np.delete(off, bounce).max() < 1e-3
    # no jump of the position at the bounce
    assert off[bounce] * sampled.period < 0.02
    around = sampled.positions[bounce - 5 : bounce + 6, 2]
    assert around.min() == pytest.approx(0.795, abs=0.008)
    assert sampled.residual < 0.001
    rows = len(sampled.positions)
    assert (rows - 1) * sampled.period == pytest.approx(np.ptp(shot.stamps), abs=0.002)


@pytest.mark.parametrize("period", [0.0, -0.002, float("nan")])
def test_a_period_that_is_none_is_refused(period: float) -> None:
    with pytest.raises(ValueError, match="period"):
        simulated_shot(np.random.default_rng(2)).resample(period)
