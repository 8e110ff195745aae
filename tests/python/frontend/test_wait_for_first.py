"""One wait for the rows of several backends."""

from collections.abc import Iterator

import pytest
from processes import WAIT

import o80


@pytest.fixture
def pair(segment: str) -> Iterator[tuple[o80.Frontend, o80.Frontend]]:
    """Two robots that stand still."""
    robot = o80.robots.load("two_joints")
    with robot.inline(f"{segment}-left") as left, robot.inline(f"{segment}-right") as right:
        yield left, right


def test_it_gives_the_rows_that_are_there(pair: tuple[o80.Frontend, o80.Frontend]) -> None:
    left, right = pair
    with pytest.raises(o80.TimeoutError, match=r"none of the rows.*is at row 0 of 1"):
        o80.wait_for_first(pair, timeout=0.0)
    right.burst(3)
    rows = o80.wait_for_first(pair, timeout=WAIT)
    assert {member: row.iteration for member, row in rows.items()} == {right: 1}
    left.burst()
    rows = o80.wait_for_first(iter(pair), timeout=WAIT)
    assert {member: row.iteration for member, row in rows.items()} == {left: 1, right: 2}
    assert right.wait_for_next(WAIT).iteration == 3
    rows = o80.wait_for_first({left: 5, right: 0}, timeout=WAIT)
    assert {member: row.iteration for member, row in rows.items()} == {right: 0}


def test_it_says_what_was_missed(segment: str) -> None:
    with o80.robots.load("two_joints").inline(segment, history=4) as frontend:
        with pytest.raises(o80.TimeoutError):
            o80.wait_for_first([frontend], timeout=0.0)
        frontend.burst(20)
        row = o80.wait_for_first([frontend])[frontend]
        assert (row.iteration, row.missed) == (frontend.oldest, frontend.oldest - 1)


def test_members_are_frontends(arm: o80.Frontend) -> None:
    nothing: list[o80.Frontend] = []
    with pytest.raises(o80.InvalidArgument, match="needs a row"):
        o80.wait_for_first(nothing)
    with pytest.raises(o80.InvalidArgument, match="frontends of o80, got 'arm'"):
        o80.wait_for_first([arm, "arm"])  # type: ignore[list-item]
    with pytest.raises(o80.InvalidArgument, match="must be a whole number, got 'soon'"):
        o80.wait_for_first({arm: "soon"})
