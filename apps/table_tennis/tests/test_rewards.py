"""The reward of an episode of ball play, and the order of what it pays."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from ball_records import landing_at, stacked, state_of, states
from hypothesis import given, settings
from hypothesis import strategies as st

from o80_table_tennis.settings import TaskSettings
from o80_table_tennis.task.ball_play import ReturnTask, SmashTask
from o80_table_tennis.task.ball_record import BallRecord
from o80_table_tennis.task.end import End, terminated
from o80_table_tennis.task.outcome import returned
from o80_table_tennis.task.rewards import REWARDS, OrderedReward, PublishedReward
from o80_table_tennis.task.state import State
from o80_table_tennis.world.table import NET_Y, TABLE

ORDERED, PUBLISHED = OrderedReward(), PublishedReward()
TARGET = np.array(ORDERED.target)
MISSED = state_of(BallRecord(0.35))
TOUCHED = state_of(BallRecord(0.0, touched=True, largest_speed=9.0, touched_floor=True))


def kind(state: State) -> int:
    """0: a miss, 1: a touch without a return, 2: a return."""
    return int(bool(state.record.touched)) + int(bool(returned(state.record)))


@settings(deadline=None)
@given(
    many=st.lists(states(), min_size=10, max_size=20),
    task=st.sampled_from([ReturnTask(), SmashTask()]),
)
def test_any_miss_earns_less_than_any_touch_and_any_touch_less_than_any_return(
    many: list[State], task: ReturnTask
) -> None:
    ended = [state for state in many if terminated(task.end(state))]
    paid = [[task.reward(state) for state in ended if kind(state) == each] for each in range(3)]
    for worse, better in ((0, 1), (1, 2), (0, 2)):
        assert max(paid[worse], default=-math.inf) < min(paid[better], default=math.inf)


@settings(deadline=None)
@given(state=states())
def test_each_kind_has_its_own_range(state: State) -> None:
    low, high = [(-1.5, 0.0), (0.0, 0.5), (1.0, 2.0)][kind(state)]
    assert low <= ORDERED.returned(state) <= high
    assert (ORDERED.returned(state) == 0.0) <= (state.record.smallest_distance == 0.0)


@settings(deadline=None)
@given(many=st.lists(states(), min_size=1, max_size=20), rule=st.sampled_from(list(REWARDS)))
def test_many_episodes_are_judged_and_paid_as_each_alone_bit_for_bit(
    many: list[State], rule: str
) -> None:
    for name in ("return", "smash"):
        task, together = TaskSettings(task=name, reward=rule).made(), stacked(many)
        for method in (task.end, task.reward):
            np.testing.assert_array_equal(method(together), [method(one) for one in many])
        assert method(together).dtype == np.float64
        infos = task.info(together)
        for key in infos:
            alone = [task.info(one)[key] for one in many]
            np.testing.assert_array_equal(infos[key], alone)
            assert np.asarray(infos[key]).dtype == np.array(alone).dtype


@settings(deadline=None)
@given(state=states())
def test_info_has_the_same_keys_and_types_in_every_state(state: State) -> None:
    info = ReturnTask().info(stacked([state]))
    assert {key: (value.dtype, *value.shape) for key, value in info.items()} == {
        "touched": (bool, 1),
        "returned": (bool, 1),
        "landing": (float, 1, 3),
        "distance": (float, 1),
        "speed": (float, 1),
        "smallest_distance": (float, 1),
    }
    assert math.isfinite(info["distance"][0]) == bool(state.record.landed)
    assert info["returned"] <= info["touched"]
    assert info["returned"] == (ReturnTask().end(state) == End.RETURNED)


def test_a_ball_that_is_missed_costs_how_far_and_no_more_than_a_metre_and_a_half() -> None:
    far = state_of(BallRecord(4.0))
    assert [ORDERED.returned(each) for each in (MISSED, far)] == [-0.35, -1.5]
    assert [PUBLISHED.returned(each) for each in (MISSED, far)] == [-0.35, -4.0]


def test_a_touch_earns_more_the_nearer_to_the_target_the_ball_ended_whatever_it_met() -> None:
    def touched(**ends: Any) -> BallRecord:
        return BallRecord(0.0, touched=True, **ends)

    behind = state_of(touched(), ball=(0.0, -0.9, 1.0, 0.0, -1.0, 0.0))
    own_half = state_of(touched(landed=True, landing=(0.0, 0.5, TABLE.top)))
    net = state_of(touched(touched_net=True, net_position=(0.0, NET_Y - 0.03, 0.8)))
    far_floor = state_of(touched(touched_floor=True, floor_position=(0.0, 3.2, 0.0)))
    paid = [float(ORDERED.returned(each)) for each in (behind, own_half, net, far_floor)]
    assert paid == sorted(paid)
    assert paid == pytest.approx([0.5 / (1 + (d / 1.5) ** 2) for d in (3.4, 2.0, 0.96, 0.7)])
    smashed = [float(ORDERED.smashed(each)) for each in (behind, own_half, net, far_floor)]
    assert smashed == paid


def test_a_return_earns_one_and_the_accuracy_of_its_landing() -> None:
    paid = [float(ORDERED.returned(state_of(landing_at(0.0, y)))) for y in (2.5, 2.7, 2.0, 1.6)]
    assert paid == pytest.approx([2.0, *(2 - (d / 3) ** 0.75 for d in (0.2, 0.5, 0.9))])
    assert ORDERED.smashed(state_of(landing_at(0.0, 2.5, largest_speed=7.0))) == 8.0


@pytest.mark.parametrize("seconds", [0, 1])
def test_no_episode_is_paid_that_goes_on_or_is_truncated(seconds: int) -> None:
    going_on = state_of(BallRecord(0.3), steps=299 + seconds)
    assert ReturnTask().reward(going_on) == 0.0
    assert ReturnTask().eventful(going_on) == bool(seconds)


def test_the_published_rule_pays_a_ball_dropped_on_ones_own_half() -> None:
    """The trap of the published rule, and why it is not the default."""
    own_half, near_miss = state_of(landing_at(0.0, 1.5)), state_of(BallRecord(0.05))
    assert PUBLISHED.returned(own_half) == pytest.approx(0.5613, abs=1e-4)
    assert PUBLISHED.returned(TOUCHED) == -0.2 < PUBLISHED.returned(near_miss)
    assert ORDERED.returned(near_miss) < ORDERED.returned(own_half) < 0.5


@pytest.mark.parametrize(
    ("distance", "reward"), [(3.0, 0.0), (1.0, 0.561309), (0.1875, 0.875), (30.0, -0.2)]
)
def test_the_published_rule_pays_a_landing_by_its_distance(distance: float, reward: float) -> None:
    landed = state_of(landing_at(distance, 2.5))
    assert PUBLISHED.returned(landed) == pytest.approx(reward, abs=1e-6)
    smashed = max(7.0 * reward, -0.2)
    fast = replace(landed, record=landing_at(distance, 2.5, largest_speed=7.0))
    assert PUBLISHED.smashed(fast) == pytest.approx(smashed, abs=1e-5)
