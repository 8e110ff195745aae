"""Actions change normalised pressures."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from o80_table_tennis.task.actions import COARSE, changed_pressures
from o80_table_tennis.world.arm import MUSCLES

MIDDLE = np.full(MUSCLES, 0.5)
normalised = arrays(np.float64, MUSCLES, elements=st.floats(0, 1))
actions = arrays(np.float64, MUSCLES, elements=st.floats(-1, 1))


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
