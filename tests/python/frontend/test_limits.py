"""Limits, fields that rest, and the fastest way, as Python sees them."""

from typing import Any

import numpy as np
import pytest
from manual_backend import ManualBackend

import o80

JOINT = {"position": float, "velocity": float}
PLACE = o80.IntegralBounds("position")


NUMBERS = ("minimum", "maximum", "speed", "acceleration", "jerk", "error", "noise")


@pytest.mark.parametrize("field", NUMBERS)
@pytest.mark.parametrize("value", ["x", "1", None, True, [1.0, 2.0], 1j])
def test_a_limit_that_is_no_number_is_named(field: str, value: Any) -> None:
    with pytest.raises(o80.InvalidArgument) as raised:
        o80.Limits(**{field: value})
    assert str(raised.value) == f"{field} of o80.Limits must be a number, got {value!r}"
    limits: Any = o80.Limits
    assert limits(**{field: np.float32(1)}) == limits(**{field: 1})


def test_so_is_whatever_else_a_robot_is_described_with(segment: str) -> None:
    bounds: Any = o80.IntegralBounds
    limits: Any = o80.Limits
    for make, text in (
        (lambda: bounds(5), "field of o80.IntegralBounds must be a string, got 5"),
        (lambda: bounds("x", minimum="low"), "minimum of o80.IntegralBounds must be a number"),
        (lambda: bounds("x", reaction=None), "reaction of o80.IntegralBounds must be a number"),
        (lambda: limits(integral="position"), "integral of o80.Limits must be o80.IntegralBounds"),
        (
            lambda: o80.Backend(segment, 1, limits={0: (None, "high")}),  # type: ignore[dict-item]
            "maximum of o80.Limits must be a number, got 'high'",
        ),
        (
            lambda: o80.Backend(segment, 1, JOINT, rests_at={0: {"velocity": "0"}}),  # type: ignore[dict-item]
            "rests_at of 'velocity' of actuator 0 must be a number, got '0'",
        ),
    ):
        with pytest.raises(o80.InvalidArgument, match=text):
            make()


def test_a_command_that_takes_longer_than_asked_says_by_how_much_and_why(segment: str) -> None:
    limits = {"joint": o80.Limits(speed=2.0, acceleration=20.0, jerk=2000.0)}
    with ManualBackend(segment, ["joint"], limits=limits) as robot:
        robot.frontend.add_command("joint", 0.5, iterations=100)
        batch = robot.frontend.pulse()
        robot.run(1)
        begun = batch.handles[0]
        assert (begun.status, begun.reason) == (o80.Status.ACTIVE, o80.Reason.LIMITS)
        robot.run(600)
        ended = batch.handles[0]

    assert (ended.status, ended.reason) == (o80.Status.COMPLETED, o80.Reason.LIMITS)
    assert begun.iteration is not None
    assert ended.iteration is not None
    assert ended.late == ended.iteration - begun.iteration + 1 - 100
    assert ended.text.startswith(f"{ended.late} iterations later than requested, because of its")
    assert begun.text == ended.text


def test_bounds_of_an_integral_reach_the_frontend(segment: str) -> None:
    bound = o80.IntegralBounds("position", minimum=-1.0, maximum=0.2, reaction=0.001)
    velocity = o80.Limits(speed=50.0, acceleration=5000.0, integral=bound)
    rests = {"joint": {"velocity": 0.0}}
    limits = {"joint": {"velocity": velocity}}
    with ManualBackend(segment, ["joint"], JOINT, limits=limits, rests_at=rests) as robot:
        position, found = robot.frontend.actuators[0].numbers
    assert (position.rest, found.rest, found.limits) == (None, 0.0, velocity)


@pytest.mark.parametrize(
    ("velocity", "said"),
    [
        ({"integral": o80.IntegralBounds("place")}, "position"),
        ({"integral": o80.IntegralBounds("velocity")}, "another field"),
        ({"integral": o80.IntegralBounds("position", 1.0, -1.0)}, "must not exceed the maximum"),
        ({"integral": o80.IntegralBounds("position", reaction=-0.1)}, "reaction"),
        ({"speed": 1.0, "acceleration": 1.0, "jerk": 1.0, "integral": PLACE}, "no limit of jerk"),
        ({"minimum": 0.5, "integral": PLACE}, "rest at 0"),
    ],
)
def test_bounds_of_an_integral_that_cannot_be_are_refused(
    segment: str, velocity: dict[str, Any], said: str
) -> None:
    rests = {} if "minimum" in velocity else {"joint": {"velocity": 0.0}}
    limits = {"joint": {"velocity": o80.Limits(**velocity)}}
    with pytest.raises(o80.InvalidArgument, match=said):
        o80.Backend(segment, ["joint"], JOINT, limits=limits, rests_at=rests)
