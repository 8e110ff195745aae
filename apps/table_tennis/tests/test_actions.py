"""Actions on pressures, and the layout of observations."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from o80_table_tennis.task import observations
from o80_table_tennis.task.actions import (
    COARSE,
    FINE,
    MUSCLES,
    REAL_RANGE,
    SIMULATED_RANGE,
    START_PRESSURE,
    PressureRange,
    changed_pressures,
)
from o80_table_tennis.task.observations import ObservationBounds, pack_observation

MIDDLE = np.full(MUSCLES, 0.5)
normalised = arrays(np.float64, MUSCLES, elements=st.floats(0, 1))
actions = arrays(np.float64, MUSCLES, elements=st.floats(-1, 1))


@pytest.mark.parametrize(("factor", "most"), [(FINE, 0.012497396), (COARSE, 0.231058579)])
def test_the_largest_action_changes_a_pressure_by_half_of_the_sigmoid(
    factor: float, most: float
) -> None:
    change = changed_pressures(MIDDLE, np.ones(MUSCLES), factor=factor) - MIDDLE

    np.testing.assert_allclose(change, most, atol=1e-8)


@settings(deadline=None)
@given(pressures=normalised, action=actions)
def test_pressures_stay_between_zero_and_one_and_move_with_the_action(
    pressures: np.ndarray, action: np.ndarray
) -> None:
    before = pressures.copy()
    after = changed_pressures(pressures, action, factor=COARSE)

    assert np.all((after >= 0) & (after <= 1))
    assert np.all((after - pressures) * action >= 0)
    np.testing.assert_array_equal(pressures, before)


def test_no_action_changes_nothing() -> None:
    np.testing.assert_array_equal(changed_pressures(MIDDLE, np.zeros(MUSCLES)), MIDDLE)


def test_an_action_outside_of_its_box_counts_as_the_edge() -> None:
    np.testing.assert_array_equal(
        changed_pressures(MIDDLE, np.full(MUSCLES, 7.0)),
        changed_pressures(MIDDLE, np.ones(MUSCLES)),
    )


@pytest.mark.parametrize("action", [np.zeros(7), np.zeros((1, 8)), np.full(8, np.nan)])
def test_a_wrong_action_is_refused(action: np.ndarray) -> None:
    with pytest.raises(ValueError, match="an action"):
        changed_pressures(MIDDLE, action)


def test_a_change_is_the_sigmoid_of_the_action_less_a_half() -> None:
    action = np.linspace(-1.0, 1.0, MUSCLES)
    change = changed_pressures(MIDDLE, action, factor=COARSE) - MIDDLE

    np.testing.assert_allclose(change, 1 / (1 + np.exp(-COARSE * action)) - 0.5, atol=1e-12)


def test_the_published_start_lies_two_thirds_up_the_simulated_range() -> None:
    np.testing.assert_allclose(
        SIMULATED_RANGE.normalised(np.full(MUSCLES, START_PRESSURE)), 2 / 3, rtol=1e-12
    )


def test_agonist_and_antagonist_of_a_joint_stand_side_by_side() -> None:
    assert REAL_RANGE.least == (15000, 16000, 15000, 16000, 13000, 13000, 13000, 13000)
    assert REAL_RANGE.most == (25000, 25000, 21500, 25000, 21000, 21000, 19000, 21900)


@settings(deadline=None)
@given(pressures=normalised)
def test_raw_pressures_come_back_normalised_to_within_rounding(pressures: np.ndarray) -> None:
    raw = REAL_RANGE.raw(pressures)

    np.testing.assert_allclose(REAL_RANGE.normalised(raw), pressures, atol=0.5 / 6000 + 1e-12)


def test_raw_pressures_never_leave_the_range() -> None:
    outside = np.array([-1.0, 2.0] * 4)

    assert SIMULATED_RANGE.raw(outside).tolist() == [6000, 24000] * 4


def test_a_range_the_wrong_way_round_names_its_muscle() -> None:
    with pytest.raises(ValueError, match="muscle 3"):
        PressureRange(least=(1, 1, 1, 5, 1, 1, 1, 1), most=(5,) * 8)
    with pytest.raises(ValueError, match="8"):
        PressureRange(least=(1,) * 4, most=(5,) * 4)


def test_each_part_of_an_observation_has_its_place() -> None:
    row = pack_observation(
        np.arange(4.0),
        np.arange(4.0, 8.0),
        np.arange(8.0, 16.0),
        np.arange(16.0, 19.0),
        np.arange(19.0, 22.0),
    )

    np.testing.assert_array_equal(row, np.arange(22.0))
    np.testing.assert_array_equal(row[observations.BALL_POSITION], [16, 17, 18])


def test_many_balls_share_the_arm() -> None:
    balls = np.arange(15.0).reshape(5, 3)
    rows = pack_observation(np.ones(4), np.zeros(4), MIDDLE, balls, -balls)

    assert rows.shape == (5, 22)
    np.testing.assert_array_equal(rows[:, observations.BALL_POSITION], balls)
    np.testing.assert_array_equal(rows[:, observations.PRESSURES], np.full((5, 8), 0.5))


@settings(deadline=None)
@given(arrays(np.float64, 22, elements=st.floats(-1e6, 1e6)))
def test_a_clipped_observation_lies_in_the_box(row: np.ndarray) -> None:
    bounds = ObservationBounds()
    clipped = bounds.clip(row)

    assert clipped.dtype == np.float32
    assert np.all((clipped >= bounds.low) & (clipped <= bounds.high))
    assert clipped.base is None


def test_the_box_has_room_for_the_robot_and_its_balls() -> None:
    bounds = ObservationBounds()
    row = pack_observation(
        np.array([0.17, 1.1, 1.04, 0.5]),
        np.full(4, 3.8),
        MIDDLE,
        np.array([0.46, 2.95, 1.37]),
        np.array([0.24, -4.14, 2.28]),
    ).astype(np.float32)

    np.testing.assert_array_equal(bounds.clip(row), row)
    assert np.all(bounds.low < bounds.high)
