"""Shots of a ball gun without any file."""

import numpy as np
import pytest

from o80_table_tennis.balls.simulated_shots import ShotVariation, simulated_shot


def test_the_same_generator_gives_the_same_shot() -> None:
    first, again = (simulated_shot(np.random.default_rng(7)) for _ in range(2))
    other = simulated_shot(np.random.default_rng(8))

    np.testing.assert_array_equal(first.positions, again.positions)
    assert not np.array_equal(first.positions, other.positions)


def test_simulated_shots_bounce_once_and_come_into_reach_like_the_recorded_ones() -> None:
    rng = np.random.default_rng(0)
    for _ in range(30):
        shot = simulated_shot(rng).resample()
        arriving = int(np.argmax(shot.positions[:, 1] < 0.4))

        assert len(shot.bounce_times) == 1
        assert 0.5 < shot.bounce_times[0] < 0.7
        assert 0.65 < arriving * shot.period < 0.9
        assert 0.85 < shot.positions[arriving, 2] < 1.4
        assert shot.duration == pytest.approx(1.28, abs=0.01)


def test_a_shot_that_cannot_bounce_once_is_refused() -> None:
    with pytest.raises(ValueError, match="bounces exactly once"):
        simulated_shot(np.random.default_rng(0), variation=ShotVariation(velocity=(0.0, 5.0, 0.0)))
