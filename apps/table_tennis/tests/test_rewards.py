"""The reward of an episode of ball play, of one or of many."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from o80_table_tennis.task.ball_record import BallRecord
from o80_table_tennis.task.rewards import RewardRule

RULE = RewardRule()
TARGET = np.array(RULE.target)
MISSED = BallRecord(0.35)
TOUCHED = BallRecord(0.0, touched=True, largest_speed=9.0)


def landing_at(x: float, y: float, largest_speed: float = 5.0) -> BallRecord:
    return BallRecord(
        0.0, touched=True, landed=True, landing=(x, y, 0.795), largest_speed=largest_speed
    )


def stacked(records: list[BallRecord]) -> BallRecord:
    """Many records as one."""
    names = BallRecord.__slots__
    return BallRecord(*(np.array([getattr(one, name) for one in records]) for name in names))


def test_without_a_touch_the_reward_is_minus_the_smallest_distance() -> None:
    assert RULE.returned(MISSED, TARGET) == -0.35
    assert RULE.smashed(MISSED, TARGET) == -0.35
    assert RULE.touched(MISSED) == -0.35


def test_a_touch_alone_is_worth_one_where_only_touches_count() -> None:
    assert RULE.touched(TOUCHED) == 1.0


def test_a_landing_on_the_target_is_worth_one() -> None:
    assert RULE.returned(landing_at(0.0, 2.5), TARGET) == 1.0


@pytest.mark.parametrize(
    ("distance", "reward"), [(3.0, 0.0), (1.0, 0.561309), (0.1875, 0.875), (30.0, -0.2)]
)
def test_a_landing_is_worth_less_the_farther_it_is(distance: float, reward: float) -> None:
    assert RULE.returned(landing_at(distance, 2.5), TARGET) == pytest.approx(reward, abs=1e-6)


def test_the_distance_is_measured_in_the_plane_of_the_table() -> None:
    assert RULE.distance((0.3, 2.1, 9.0), TARGET) == pytest.approx(0.5)


def test_a_touch_without_a_landing_is_worth_the_floor() -> None:
    assert RULE.returned(TOUCHED, TARGET) == -0.2
    assert RULE.smashed(TOUCHED, TARGET) == -0.2


def test_a_smash_multiplies_by_the_largest_speed_and_keeps_the_floor() -> None:
    assert RULE.smashed(landing_at(0.0, 2.5, largest_speed=7.0), TARGET) == 7.0
    assert RULE.smashed(landing_at(3.5, 2.5, largest_speed=7.0), TARGET) == -0.2


@settings(deadline=None)
@given(x=st.floats(-5, 5), y=st.floats(-5, 8), speed=st.floats(0, 30))
def test_a_touch_is_never_worth_less_than_the_floor(x: float, y: float, speed: float) -> None:
    record = landing_at(x, y, largest_speed=speed)

    assert -0.2 <= RULE.returned(record, TARGET) <= 1.0
    assert -0.2 <= RULE.smashed(record, TARGET) <= max(speed, 1.0)


def test_many_episodes_are_paid_as_each_alone_and_as_the_formula_says_bit_for_bit() -> None:
    rng = np.random.default_rng(1)
    records = [
        landing_at(rng.uniform(-2, 4), rng.uniform(-2, 4), rng.uniform(0, 9)) for _ in range(200)
    ]
    records += [MISSED, TOUCHED]
    for rule in (RULE.returned, RULE.smashed):
        together = rule(stacked(records), np.tile(TARGET, (len(records), 1)))
        np.testing.assert_array_equal(together, [rule(one, TARGET) for one in records])

    distances = [math.dist(one.landing[:2], TARGET[:2]) for one in records[:200]]
    terms = [max(1.0 - math.pow(d / 3.0, 0.75), -0.2) for d in distances]
    together = RULE.returned(stacked(records[:200]), np.tile(TARGET, (200, 1)))
    np.testing.assert_array_equal(together, terms)
