"""A burst that is made again and again: targets in, iterations, all their rows out."""

import pickle

import numpy as np
import pytest
from processes import WAIT

import o80


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
