"""The reward of an episode and the reasons why it ends."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from o80_table_tennis.task.rewards import BallRecord, End, EndRule, RewardRule

RULE = RewardRule()
SMASH = RewardRule(smash=True)


def hit_landing_at(x: float, y: float, largest_speed: float = 5.0) -> BallRecord:
    return BallRecord(
        smallest_distance=0.0, y=y, hit=True, landing=(x, y), largest_speed=largest_speed
    )


def test_without_a_hit_the_reward_is_minus_the_smallest_distance() -> None:
    assert RULE.reward(BallRecord(smallest_distance=0.35, y=-0.9)) == -0.35
    assert SMASH.reward(BallRecord(smallest_distance=0.35, y=-0.9)) == -0.35


def test_a_landing_on_the_target_is_worth_one() -> None:
    assert RULE.reward(hit_landing_at(0.0, 2.5)) == 1.0


@pytest.mark.parametrize(
    ("distance", "reward"), [(3.0, 0.0), (1.0, 0.561309), (0.1875, 0.875), (30.0, -0.2)]
)
def test_a_landing_is_worth_less_the_farther_it_is(distance: float, reward: float) -> None:
    assert RULE.reward(hit_landing_at(distance, 2.5)) == pytest.approx(reward, abs=1e-6)


def test_the_distance_is_measured_in_the_plane_of_the_table() -> None:
    assert RULE.distance((0.3, 2.1)) == pytest.approx(0.5)


def test_a_hit_without_a_landing_is_worth_the_floor() -> None:
    hit = BallRecord(smallest_distance=0.0, y=3.5, hit=True, touched_floor=True, largest_speed=9.0)

    assert RULE.reward(hit) == -0.2
    assert SMASH.reward(hit) == -0.2


def test_a_smash_multiplies_by_the_largest_speed_and_keeps_the_floor() -> None:
    assert SMASH.reward(hit_landing_at(0.0, 2.5, largest_speed=7.0)) == 7.0
    assert SMASH.reward(hit_landing_at(3.5, 2.5, largest_speed=7.0)) == -0.2


@settings(deadline=None)
@given(x=st.floats(-5, 5), y=st.floats(-5, 8), speed=st.floats(0, 30))
def test_a_hit_is_never_worth_less_than_the_floor(x: float, y: float, speed: float) -> None:
    hit = hit_landing_at(x, y, largest_speed=speed)

    assert -0.2 <= RULE.reward(hit) <= 1.0
    assert -0.2 <= SMASH.reward(hit) <= max(speed, 1.0)


@pytest.mark.parametrize(
    ("ball", "end"),
    [
        (BallRecord(smallest_distance=1.0, y=1.0), End.RUNNING),
        (hit_landing_at(0.0, 2.0), End.LANDED),
        (BallRecord(smallest_distance=1.0, y=1.5, touched_net=True), End.NET),
        (BallRecord(smallest_distance=1.0, y=3.5, hit=True, touched_floor=True), End.FLOOR),
        (BallRecord(smallest_distance=1.0, y=-0.81), End.PASSED),
        (BallRecord(smallest_distance=1.0, y=-0.8), End.RUNNING),
    ],
)
def test_an_episode_ends_by_what_happens_to_the_ball(ball: BallRecord, end: End) -> None:
    assert EndRule().judge(ball, steps=299) is end


def test_only_the_count_of_steps_truncates() -> None:
    ball = BallRecord(smallest_distance=1.0, y=1.0)

    end = EndRule().judge(ball, steps=300)
    assert end is End.OUT_OF_STEPS
    assert end.truncated
    assert not end.terminated
    landed = EndRule().judge(hit_landing_at(0.0, 2.0), steps=300)
    assert landed.terminated
    assert not landed.truncated
    assert not End.RUNNING.terminated
    assert not End.RUNNING.truncated


def test_a_landing_before_any_hit_is_refused() -> None:
    with pytest.raises(ValueError, match="needs a hit"):
        BallRecord(smallest_distance=1.0, y=1.0, landing=(0.0, 1.0))
