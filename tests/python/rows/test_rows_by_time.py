"""Rows by their time and iteration, of a living segment and of a history."""

import itertools
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import o80

_names = (f"test-times-{i}" for i in itertools.count())
MILLISECOND = 1_000_000


@pytest.fixture(scope="module")
def old() -> Iterator[o80.Frontend]:
    """A robot of which rows 69 to 100 are left, at 1000 Hz of simulated time."""
    with o80.robots.load("two_joints").inline(next(_names), history=32) as frontend:
        frontend.burst(100)
        yield frontend


TIMES = st.integers(-5 * MILLISECOND, 105 * MILLISECOND)


@settings(deadline=None)
@given(TIMES)
def test_the_row_at_a_time_is_the_newest_at_or_before_it(old: o80.Frontend, time: int) -> None:
    history = old.history()
    earlier = history.iteration[history.time <= time]
    for source in (old, history):
        if len(earlier):
            assert source.at_time(time).iteration == earlier[-1]
        else:
            with pytest.raises(o80.RowOverwritten, match="ns or before"):
                source.at_time(time)


@settings(deadline=None)
@given(
    st.one_of(st.none(), TIMES),
    st.one_of(st.none(), TIMES),
    st.integers(60, 110),
    st.integers(60, 110),
)
def test_rows_between_times_are_those_that_numpy_finds(
    old: o80.Frontend, first: int | None, last: int | None, since: int, until: int
) -> None:
    history = old.history()
    wanted = (history.iteration >= since) & (history.iteration <= until)
    wanted &= history.time >= (first if first is not None else -(10**18))
    wanted &= history.time <= (last if last is not None else 10**18)
    arguments: dict[str, Any] = {
        "since": since,
        "until": until,
        "from_time": first,
        "to_time": last,
    }
    for rows in (old.history(**arguments), history.select(**arguments)):
        assert rows.iteration.tolist() == history.iteration[wanted].tolist()


@settings(deadline=None)
@given(st.floats(0, 0.2))
def test_the_last_seconds_count_from_the_newest_row(old: o80.Frontend, seconds: float) -> None:
    history = old.history()
    wanted = history.time > history.time[-1] - round(seconds * 1e9)
    for rows in (old.history(seconds=seconds), history.select(seconds=seconds)):
        assert rows.iteration.tolist() == history.iteration[wanted].tolist()
    assert len(old.history(seconds=1e300)) == len(history)
    n = round(seconds * 200)
    assert old.history(n).iteration.tolist() == history.select(n).iteration.tolist()


@settings(deadline=None)
@given(st.integers(0, 40), st.integers(1, 7), TIMES)
def test_a_part_of_a_history_is_a_history(old: o80.Frontend, n: int, step: int, time: int) -> None:
    part = old.history()[::step]
    iterations = part.iteration.tolist()
    assert part.select(n).iteration.tolist() == iterations[max(0, len(iterations) - n) :]
    assert [part.at_iteration(k).iteration for k in iterations] == iterations
    expected = part.iteration[part.time >= time].tolist()
    assert part.select(from_time=time).iteration.tolist() == expected


def test_a_row_of_a_history_is_found_by_its_iteration(old: o80.Frontend) -> None:
    history = old.history(10)
    assert history.at_iteration(95).iteration == 95
    assert history[-1].iteration == 100
    with pytest.raises(o80.RowOverwritten, match=r"row 5 is not in .* holds rows 91"):
        history.at_iteration(5)
    with pytest.raises(o80.RowOverwritten, match="which is empty"):
        history[:0].at_iteration(95)
    with pytest.raises(o80.RowOverwritten, match="which is empty"):
        history[:0].at_time(0)
    with pytest.raises(o80.InvalidArgument, match="step of a slice must be positive, got -1"):
        history[::-1]


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ({"n": 3, "seconds": 1.0}, "give either n, or seconds"),
        ({"n": 3, "since": 1}, "give either n, or seconds"),
        ({"seconds": 1.0, "to_time": 1}, "give either n, or seconds"),
        ({"seconds": -1.0}, "seconds must be a finite number of at least 0, got -1.0"),
        ({"seconds": float("inf")}, "seconds must be"),
        ({"seconds": "2"}, "seconds must be"),
        ({"from_time": 0.5}, "from_time must be a whole number, got 0.5"),
        ({"n": -1}, "must be at least 0, got -1"),
    ],
)
def test_a_selection_that_cannot_be_is_refused(
    old: o80.Frontend, arguments: dict[str, object], text: str
) -> None:
    for ask in (old.history, old.history().select):
        with pytest.raises(o80.InvalidArgument, match=text):
            ask(**arguments)  # type: ignore[arg-type]


def test_a_selection_of_nothing_is_empty(old: o80.Frontend) -> None:
    nothing = old.history(since=10**9)
    assert len(nothing) == 0
    assert len(nothing.select(seconds=1.0)) == 0
    assert np.array_equal(nothing.select(3).time, [])
