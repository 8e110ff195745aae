"""Bursts of a group, rows of several robots, and a burst that is made again and again."""

import pickle
from collections.abc import Iterator

import numpy as np
import pytest
from processes import WAIT

import o80


def test_a_group_may_return_at_once(segment: str) -> None:
    robot = o80.robots.load("two_joints")
    with (
        robot.start(f"{segment}-left", bursting=True) as one,
        robot.start(f"{segment}-right", bursting=True) as two,
        one.frontend() as left,
        two.frontend() as right,
    ):
        group = o80.burst({left: 5, right: 7}, wait=False)
        rows = group.wait(WAIT)

        assert group.done
        assert {left: rows[left].iteration, right: rows[right].iteration} == {left: 5, right: 7}
        assert group.bursts[left].done

        group = o80.burst({left: 10**15, right: 10**15}, wait=False)
        assert not group.done
        group.cancel()
        rows = group.wait(WAIT)
        assert left.burst(1, timeout=WAIT).iteration == rows[left].iteration + 1

        burst = left.burst(10**15, wait=False)
        seen = left.wait_for_next(timeout=WAIT).iteration
        burst.cancel()
        assert burst.wait(WAIT).iteration >= seen
        assert burst.done


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


# ----------------------------------------------------------------------------------------- prepared


def test_it_does_what_single_calls_do(segment: str) -> None:
    targets = np.random.default_rng(1).uniform(-1, 1, (20, 2, 2))
    robot = o80.robots.load("two_joints")
    with robot.inline(segment) as one, robot.inline(f"{segment}-b") as other:
        burst = one.prepared_burst(5, steps=2, each=2, profile="minimum_jerk")
        for wanted in targets:
            burst.targets[...] = wanted
            burst.run()
            other.add_trajectory(wanted, iterations=2, profile="minimum_jerk")
            other.burst(5)

        np.testing.assert_array_equal(one.history().rows, other.history().rows)


def test_what_comes_late_is_rejected_or_taken_at_once(arm: o80.Frontend) -> None:
    arm.burst(10)
    burst = arm.prepared_burst(2)
    burst.targets[...] = 0.5
    with pytest.raises(o80.Error, match="after the iteration for which it was sent"):
        burst.run(at=5)
    assert arm.latest().iteration == 10, "a rejected batch does not burst"

    assert burst.run(at=5, late="now") == 12
    assert burst.rows["desired"][:, 0].tolist() == [0.5, 0.5]


def test_what_was_not_filled_is_refused(arm: o80.Frontend) -> None:
    burst = arm.prepared_burst(1)
    burst.targets[0, 0] = 0.5
    with pytest.raises(o80.InvalidArgument, match=r"elbow.* is not a finite number"):
        burst.run()

    assert arm.latest().iteration == 0
    assert arm.added == 0


def test_an_array_that_is_assigned_is_copied_into_its_targets(arm: o80.Frontend) -> None:
    burst = arm.prepared_burst(1, steps=1)
    action = np.array([[0.3, -0.6]])
    burst.targets = action
    action[:] = 0
    burst.run(WAIT)
    assert burst.rows["desired"].tolist() == [[0.3, -0.6]]

    burst.targets = [[1, 0]]
    burst.run(WAIT)
    assert burst.rows["desired"].tolist() == [[1.0, 0.0]]


def test_targets_of_another_shape_or_type_and_rows_cannot_be_assigned(arm: o80.Frontend) -> None:
    burst = arm.prepared_burst(1)
    with pytest.raises(o80.InvalidArgument, match="dtype float64"):
        burst.targets = [["a", "b"]]
    for wrong in ([0.3, -0.6], 0.3, [[0.1], [0.2]], "x", None):
        with pytest.raises(o80.InvalidArgument, match=r"\(steps, actuators\) = \(1, 2\), got"):
            burst.targets = wrong  # type: ignore[assignment]
    with pytest.raises(AttributeError):
        burst.rows = np.zeros(1)  # type: ignore[misc]
    with pytest.raises(TypeError, match="cannot be pickled"):
        pickle.dumps(burst)
