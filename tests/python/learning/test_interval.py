"""The interval of a counted share."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from o80.learning.training import wilson


@pytest.mark.parametrize(
    ("successes", "count", "low", "high"),
    # Brown, Cai, DasGupta (2001) and R's binom.confint(method="wilson")
    [(0, 10, 0.0, 0.27753), (5, 10, 0.23659, 0.76341), (10, 10, 0.72247, 1.0), (0, 0, 0.0, 1.0)],
)
def test_known_intervals(successes: int, count: int, low: float, high: float) -> None:
    assert wilson(successes, count) == pytest.approx((low, high), abs=1e-5)


@given(count=st.integers(1, 10**6), share=st.floats(0, 1))
def test_it_holds_the_share_and_narrows_with_the_count(count: int, share: float) -> None:
    successes = round(share * count)
    low, high = wilson(successes, count)
    assert 0 <= low <= successes / count <= high <= 1
    many_low, many_high = wilson(4 * successes, 4 * count)
    assert many_high - many_low < high - low


def test_more_than_all_is_refused() -> None:
    with pytest.raises(ValueError, match="between 0 and 3, got 4"):
        wilson(4, 3)
