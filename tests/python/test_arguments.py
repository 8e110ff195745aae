"""Arguments of the wrong type or range, and options that contradict each other, are refused with a
sentence that names the argument.
"""

from collections.abc import Callable
from typing import Any

import pytest

import o80


@pytest.mark.parametrize(
    ("call", "text"),
    [
        (lambda arm: arm.resume(-1), "number of a halt must be at least 1, got -1"),
        (lambda arm: arm.resume("x"), "number of a halt must be a whole number, got 'x'"),
        (lambda arm: arm.halt(None), "reason of a halt must be a string, got None"),
        (lambda arm: arm.history("x"), "observations, must be a whole number, got 'x'"),
        (lambda arm: arm.history(since="x"), "since must be a whole number, got 'x'"),
        (lambda arm: arm.prepared_burst("x"), "a burst must be a whole number, got 'x'"),
        (lambda arm: arm.add_trajectory([[0, 0]], times="abc"), "times .* not 'abc'"),
        (lambda arm: arm.add_command(0, 0.1, mode=None), "mode must be one of .*, got None"),
        (lambda arm: arm.add_command(0, 0.1, start=None), "start must be one of .*, got None"),
        (lambda arm: arm.add_command(0, 0.1, every=0), "every must be positive, got 0"),
        (lambda arm: arm.add_command(0, 0.1, every="x"), "every .*'x'"),
        (lambda arm: arm.add_command(0, 0.1, every=True), "every .* got True"),
        (lambda arm: arm.add_command(0, 0.1, every=2**62), "every must be seconds or a number"),
        (lambda arm: arm.add_command(0, 0.1, fastest=1), "fastest must be True or False, got 1"),
        (lambda arm: arm.add_command(True, 0.1), "index or its name, got True"),
        (lambda arm: arm.add_command(1.5, 0.0), "index or its name, got 1.5"),
        (lambda arm: arm.add_command("wrist", 0.0), "shoulder.*elbow"),
        (lambda arm: arm.add_command(2, 0.0), "shoulder.*elbow"),
        (lambda arm: arm.add_command(-1, 0.0), "shoulder.*elbow"),
        (
            lambda arm: arm.add_command(0, 0.5, duration=1.0, iterations=3),
            "duration, speed, until, iterations and fastest",
        ),
        (lambda arm: arm.add_command(0, 0.5, profile="fastest"), "fastest=True"),
        (
            lambda arm: arm.add_command(0, 0.1, every=0.02, duration=1.0),
            "every is for set-points",
        ),
        (
            lambda arm: arm.add_command(0, 0.1, profile="as_sent", duration=1.0),
            "as_sent is for set-points",
        ),
        (
            lambda arm: arm.add_command(0, 0.1, fastest=True, profile="linear"),
            "has no profile",
        ),
    ],
)
def test_a_frontend_says_which_argument_is_wrong(
    arm: o80.Frontend, call: Callable[[Any], object], text: str
) -> None:
    with pytest.raises(o80.InvalidArgument, match=text):
        call(arm)

    assert arm.added == 0
    assert arm.halted is None


@pytest.mark.parametrize(
    ("wrong", "text"),
    [
        ({"actuators": -1}, "number of actuators must be at least 0, got -1"),
        ({"requests": ["home"]}, r"requests must be a mapping from names .*, got \['home'\]"),
        ({"limits": [1.0]}, "limits must be a mapping from actuators"),
    ],
)
def test_a_backend_says_which_argument_is_wrong(
    segment: str, wrong: dict[str, Any], text: str
) -> None:
    with pytest.raises(o80.InvalidArgument, match=text):
        o80.Backend(segment, **{"actuators": ["a"], **wrong})

    assert segment not in [entry.name for entry in o80.segments()]


def test_a_target_that_gives_no_field_is_refused(segment: str) -> None:
    fields = {"position": float, "velocity": float}
    with o80.Backend(segment, ["a"], fields) as backend:
        backend.publish()
        with o80.Frontend(segment) as frontend:
            with pytest.raises(o80.InvalidArgument, match=r"names no field.*position"):
                frontend.add_command("a", {})
            assert frontend.added == 0
