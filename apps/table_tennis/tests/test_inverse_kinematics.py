"""Angles that bring the racket to a point, and the way back."""

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from o80_table_tennis.players.inverse_kinematics import posture_towards
from o80_table_tennis.world.arm import FOREARM, JOINT_LIMIT, SHOULDER, UPPER_ARM, racket_pose

PLAYING = np.array([0.17, 1.1, 1.04, 0.5])

Numbers = npt.NDArray[np.float64]


def postures(count: int) -> list[Numbers]:
    return list(np.random.default_rng(3).uniform(-1.4, 1.4, (count, 4)))


def test_postures_reach_their_points() -> None:
    for q in postures(60):
        q[1:3] = np.abs(q[1:3])  # away from the base, the elbow up
        point = racket_pose(q).position
        assert racket_pose(posture_towards(point, 0.0)).position == pytest.approx(point)
    assert posture_towards(racket_pose(PLAYING).position, 0.5) == pytest.approx(PLAYING)


@given(
    *(st.floats(0.0, 1.5), st.floats(-1.0, 1.0), st.floats(0.5, 2.5), st.floats(-2.0, 2.0)),
)
def test_every_posture_is_within_the_stops(x: float, y: float, z: float, wrist: float) -> None:
    assert np.all(np.abs(posture_towards((x, y, z), wrist)) <= JOINT_LIMIT)


@pytest.mark.parametrize(
    ("point", "nearest"),
    [
        ((2.0, 0.0, SHOULDER), UPPER_ARM + FOREARM),  # too far: the arm is straight
        ((0.3, 0.0, SHOULDER), np.hypot(UPPER_ARM, FOREARM)),  # too near: a right angle
    ],
)
def test_out_of_reach_the_racket_comes_near(
    point: tuple[float, float, float], nearest: float
) -> None:
    position = racket_pose(posture_towards(point, 0.0)).position
    assert position == pytest.approx((nearest, 0.0, SHOULDER), abs=0.005)
