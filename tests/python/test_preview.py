"""A preview says what a command would do, bit for bit, and sends nothing."""

import dataclasses
import pickle
import random
from typing import Any

import numpy as np
import pytest

import o80

JOINT = {"position": float, "velocity": float, "held": bool}


def random_limits(rng: random.Random) -> o80.Limits:
    rates: dict[str, Any] = {"speed": rng.uniform(1, 4), "acceleration": rng.uniform(5, 40)}
    if rng.random() < 0.5:
        rates["jerk"] = rng.uniform(200, 2000)
    return o80.Limits(minimum=-1.0, maximum=1.0, **rates)


def random_target(rng: random.Random, actuator: str) -> Any:
    if actuator == "slide":
        return rng.uniform(-1, 1)
    given = {
        "position": rng.uniform(-1, 1),
        "velocity": rng.uniform(-1, 1),
        "held": rng.random() < 0.5,
    }
    return {name: given[name] for name in rng.sample(sorted(given), rng.randint(1, 3))}


def random_command(rng: random.Random, next_iteration: int) -> dict[str, Any]:
    names = rng.sample(["joints_0", "joints_1", "slide"], rng.randint(1, 3))
    targets = [random_target(rng, name) for name in names]
    n = rng.randint(1, 200)
    command: dict[str, Any] = rng.choice(
        [
            {"duration": n / 1000},
            {"speed": rng.uniform(0.3, 1.0)},
            {"until": next_iteration + n - 1},
            {"iterations": n},
            {"every": rng.choice([n, n / 1000])},
            {},
        ]
    )
    if rng.random() < 0.5:
        command["profile"] = rng.choice(["linear", "minimum_jerk"])
    if len(names) == 1 and rng.random() < 0.5:
        return {"actuator": names[0], "target": targets[0], **command}
    return {"actuator": names, "target": targets, **command}


@pytest.mark.parametrize("seed", range(4))
def test_the_robot_then_does_it_bit_for_bit(segment: str, seed: int) -> None:
    rng = random.Random(seed)
    limits: Any = {
        "joints_0": {"position": random_limits(rng)},
        "joints_1": {"velocity": random_limits(rng)},
        "slide": random_limits(rng),
    }
    groups: Any = {"joints": (JOINT, 2), "slide": float}
    with o80.Backend(segment, groups, frequency=1000.0, limits=limits) as backend:
        backend.publish({"joints": [(0.0, 0.0, False)] * 2, "slide": 0.0})
        frontend = o80.Frontend(segment)
        observer = o80.Frontend(segment, read_only=True)
        for _ in range(20):
            command = random_command(rng, observer.latest().iteration + 1)
            preview = observer.preview(**command)
            frontend.add_command(**command)
            batch = frontend.pulse()
            for _ in range(preview.iterations):
                assert not batch.ended
                desired = backend.step()
                assert desired is not None
                backend.publish(desired)

            handle = batch.handles[0]
            assert handle.status == o80.Status.COMPLETED
            assert (preview.late, preview.text) == (handle.late, handle.text)
            rows = frontend.history(preview.iterations).desired
            assert np.array_equal(rows["slide"], preview.rows["slide"])
            for field in JOINT:
                assert np.array_equal(rows["joints"][field], preview.rows["joints"][field])


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
        ({"target": float("nan")}, "not a finite number"),
        ({"target": {"position": 1.0}}, "the target of actuator 'elbow'"),
        ({"target": 0.1, "speed": 1.0, "duration": 1.0}, "one of"),
        ({"target": 0.1, "fastest": True}, "fastest motion"),
        ({"target": 0.1, "until": 0}, "too late"),
        ({"target": 0.1, "iterations": 10**7}, "more than 1000000 iterations"),
        ({"target": 0.1, "duration": 1.0, "every": 0.1}, "every"),
        ({"target": 0.1, "initial": "here"}, "initial: the target of actuator 'elbow'"),
        ({"target": 0.1, "initial": float("inf")}, "'elbow' begins"),
        ({"target": 0.1, "actuator": "knee"}, "'knee'"),
        ({"target": [0.1], "actuator": ["elbow", "shoulder"]}, "a target for each"),
        ({"target": [0.1], "actuator": ["elbow"], "initial": 0.1}, "initial: a command for 1"),
        ({"target": [0.1, 0.2], "actuator": ["elbow", "elbow"]}, "twice"),
    ],
)
def test_wrong_input_is_refused(arm: o80.Frontend, arguments: dict[str, Any], says: str) -> None:
    with pytest.raises(o80.InvalidArgument, match=says):
        arm.preview(**{"actuator": "elbow", **arguments})
    assert arm.added == 0
