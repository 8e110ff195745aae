"""Raw pressures and normalised ones; the ranges come from the arm."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

import o80
from o80_table_tennis.rig.pressure_range import PressureRange
from o80_table_tennis.world.arm import MUSCLES

REAL = PressureRange(
    (15000, 16000, 15000, 16000, 13000, 13000, 13000, 13000),
    (25000, 25000, 21500, 25000, 21000, 21000, 19000, 21900),
)


@settings(deadline=None)
@given(pressures=arrays(np.float64, MUSCLES, elements=st.floats(0, 1)))
def test_raw_pressures_come_back_normalised_to_within_rounding(pressures: np.ndarray) -> None:
    raw = REAL.raw(pressures)

    np.testing.assert_array_equal(raw, np.rint(raw))
    assert np.all((raw >= REAL.least) & (raw <= REAL.most))
    np.testing.assert_allclose(REAL.normalised(raw), pressures, atol=0.5 / 6000 + 1e-12)


@pytest.mark.parametrize(
    ("ranges", "least", "most"),
    [("simulated", [6000.0] * 8, [24000.0] * 8), ("real", REAL.least, REAL.most)],
)
def test_the_ranges_are_the_limits_of_the_arm(
    ranges: str, least: list[float], most: list[float]
) -> None:
    with o80.robots.load("pam").inline(f"pressure-range-{ranges}", ranges=ranges) as arm:
        found = PressureRange.of(arm)
    np.testing.assert_array_equal(found.least, least)
    np.testing.assert_array_equal(found.most, most)
