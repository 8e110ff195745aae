"""Time stamps of rows that have none."""

from collections.abc import Callable

import numpy as np
import pytest
from recorded_rows import ball_gun_shots, frames_at_random, frames_of_a_reader, rows_seen

from o80_table_tennis.balls.frame_stamps import FRAME_PERIOD, frames_of


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize(
    ("frames_read", "lag"), [(frames_of_a_reader, 0.025), (frames_at_random, 0.0)]
)
def test_the_frames_of_rows_without_stamps_are_found(
    seed: int, frames_read: Callable[[np.random.Generator, float], np.ndarray], lag: float
) -> None:
    rng = np.random.default_rng(seed)
    frames = frames_read(rng, 1.25)
    rows = rows_seen(rng, frames, noise=0.001, lag=lag)

    found = frames_of(rows[:, :3], rows[:, 3:], np.arange(len(rows)))

    np.testing.assert_array_equal(found, frames - frames[0])


@pytest.mark.recordings("ball_gun_2019")
def test_most_rows_of_the_ball_gun_are_one_or_two_frames_apart() -> None:
    for shot in ball_gun_shots():
        frames = np.rint(shot.stamps / FRAME_PERIOD)
        np.testing.assert_allclose(shot.stamps, frames * FRAME_PERIOD)
        assert np.mean(np.isin(np.diff(frames), (1, 2))) > 0.9, shot.name
