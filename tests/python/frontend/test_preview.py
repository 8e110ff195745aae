"""A preview says what a command would do, bit for bit, and sends nothing."""

import dataclasses
import pickle
from typing import Any

import numpy as np
import pytest

import o80

JOINT = {"position": float, "velocity": float, "held": bool}


def test_it_says_how_many_iterations_and_the_states_of_all_actuators(arm: o80.Frontend) -> None:
    preview = arm.preview("elbow", 0.4, iterations=4)

    assert (preview.iterations, preview.late, preview.text) == (4, 0, "")
    assert preview.rows.tolist() == [[0, 0.1], [0, 0.2], [0, 0.30000000000000004], [0, 0.4]]
    assert arm.added == 0
    assert arm.latest().iteration == 0
    assert "rows" not in repr(preview)
    again = pickle.loads(pickle.dumps(preview))
    assert np.array_equal(again.rows, preview.rows)
    with pytest.raises(dataclasses.FrozenInstanceError):
        preview.late = 3  # type: ignore[misc]


def test_it_may_begin_elsewhere(arm: o80.Frontend) -> None:
    first = arm.preview(None, [0.4, 0.8], iterations=2)
    then = arm.preview("elbow", 0.0, iterations=2, initial=first.rows[-1][1])
    both = arm.preview([1, 0], [0.0, 0.2], iterations=2, initial=[0.8, 0.4])

    assert then.rows.tolist() == [[0, 0.4], [0, 0]]
    assert both.rows.tolist() == [[0.30000000000000004, 0.4], [0.2, 0]]


def test_initial_fields_that_are_left_out_are_those_of_the_newest_row(segment: str) -> None:
    with o80.Backend(segment, ["joint"], JOINT) as backend:
        backend.publish({"position": 1.0, "velocity": 2.0, "held": True})
        preview = o80.Frontend(segment).preview(
            "joint", {"position": 4.0}, iterations=2, initial={"position": 2.0}
        )

    assert preview.rows[:, 0].tolist() == [(3.0, 2.0, True), (4.0, 2.0, True)]


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ({"target": 4.0}, "outside its limits"),
        ({"target": 0.1, "initial": "here"}, "initial: the target of actuator 'elbow'"),
        ({"target": 0.1, "initial": float("inf")}, "'elbow' begins"),
        ({"target": [0.1], "actuator": ["elbow"], "initial": 0.1}, "initial: a command for 1"),
    ],
)
def test_wrong_input_is_refused(arm: o80.Frontend, arguments: dict[str, Any], says: str) -> None:
    with pytest.raises(o80.InvalidArgument, match=says):
        arm.preview(**{"actuator": "elbow", **arguments})
    assert arm.added == 0
