"""One wait for the rows of several backends."""

import threading
from collections.abc import Iterator

import pytest

import o80

WAIT = 30.0  # [s] longer than any wait should take


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


def test_it_waits_for_given_iterations(pair: tuple[o80.Frontend, o80.Frontend]) -> None:
    left, right = pair
    left.burst(2)
    rows = o80.wait_for_first({left: 5, right: 0}, timeout=WAIT)
    assert {member: row.iteration for member, row in rows.items()} == {right: 0}


def test_it_says_what_was_missed(segment: str) -> None:
    with o80.robots.load("two_joints").inline(segment, history=4) as frontend:
        with pytest.raises(o80.TimeoutError):
            o80.wait_for_first([frontend], timeout=0.0)
        frontend.burst(20)
        row = o80.wait_for_first([frontend])[frontend]
        assert (row.iteration, row.missed) == (frontend.oldest, frontend.oldest - 1)


def test_every_row_of_robots_by_the_clock_comes_once(segment: str) -> None:
    robot = o80.robots.load("two_joints")
    with (
        robot.start(f"{segment}-fast", frequency=1000) as fast,
        robot.start(f"{segment}-slow", frequency=200) as slow,
        fast.frontend() as left,
        slow.frontend() as right,
        o80.Frontend(f"{segment}-slow", read_only=True) as reader,
    ):
        seen: dict[o80.Frontend, list[int]] = {left: [], right: [], reader: []}
        while min(map(len, seen.values())) < 20:
            for member, row in o80.wait_for_first([left, right, reader], timeout=WAIT).items():
                seen[member].append(row.iteration - row.missed)
        for iterations in seen.values():
            assert len(set(iterations)) == len(iterations)
            assert iterations == sorted(iterations)


def test_the_end_of_one_ends_the_wait_naming_it(segment: str) -> None:
    robot = o80.robots.load("two_joints")
    with (
        robot.start(f"{segment}-left", bursting=True) as left,
        robot.start(f"{segment}-right", bursting=True) as right,
        left.frontend() as alive,
        right.frontend() as ending,
    ):
        stopper = threading.Thread(target=right.stop)
        stopper.start()
        with pytest.raises(o80.BackendStopped, match=f"{segment}-right"):
            o80.wait_for_first([alive, ending], timeout=WAIT)
        stopper.join()
        assert alive.alive


@pytest.mark.parametrize("wrong", [[], {}])
def test_nothing_to_wait_for_is_refused(wrong: object) -> None:
    with pytest.raises(o80.InvalidArgument, match="needs a row"):
        o80.wait_for_first(wrong)  # type: ignore[arg-type]


def test_members_are_frontends(arm: o80.Frontend) -> None:
    with pytest.raises(o80.InvalidArgument, match="frontends of o80, got 'arm'"):
        o80.wait_for_first([arm, "arm"])  # type: ignore[list-item]
    with pytest.raises(o80.InvalidArgument, match="must be a whole number, got 'soon'"):
        o80.wait_for_first({arm: "soon"})
