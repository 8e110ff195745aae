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
        (lambda arm: arm.resume("x"), "number of a halt must be a whole number, got 'x'"),
        (lambda arm: arm.history("x"), "observations, must be a whole number, got 'x'"),
        (lambda arm: arm.history(since="x"), "since must be a whole number, got 'x'"),
        (lambda arm: arm.wait_for(-1), "no row -1: rows begin at 0"),
        (lambda arm: arm.journal(since=-1), "since must be .*, got -1"),
        (lambda arm: arm.journal(since="first"), "since must be .*, got 'first'"),
        (lambda arm: arm.journal(since=True), "since must be .*, got True"),
        (lambda arm: arm.mark(3), "text of a mark must be a string, got 3"),
        (lambda arm: arm.mark("\ud800"), r"text of a mark must be valid Unicode, got '\\ud800'"),
        (lambda arm: arm.mark("two\nlines"), r"one line of printable text, got 'two\\nlines'"),
        (lambda arm: arm.request("launch"), "reset, snapshot, restore"),
        (lambda arm: arm.request("reset", sed=1), "seed"),
        (lambda arm: arm.request("reset", seed=-1), "seed"),
        (lambda arm: arm.burst(0), "iterations .* at least 1, got 0"),
        (lambda arm: arm.burst("many"), "a burst must be a whole number, got 'many'"),
        (lambda arm: o80.burst({arm: arm}), "a burst must be a whole number"),
        (lambda arm: arm.burst(1, at=9, late="never"), "late must be 'reject' or 'now'"),
        (lambda arm: arm.burst(1, at=-5, wait=False), "at must be at least iteration 0, got -5"),
        (lambda arm: arm.pulse(at=-7), "at must be at least iteration 0, got -7"),
        (lambda arm: arm.pulse(late="never"), "late must be 'reject' or 'now'"),
        (lambda arm: arm.prepared_burst("x"), "a burst must be a whole number, got 'x'"),
        (lambda arm: arm.prepared_burst(steps=0), "steps .* at least 1, got 0"),
        (lambda arm: arm.prepared_burst(each=0), "each .* at least 1, got 0"),
        (lambda arm: arm.add_trajectory([[0, 0]], speed=0.0), "speed 0 .* positive"),
        (lambda arm: arm.add_trajectory([[0, 0]], times="abc"), "times .* got 'abc'"),
        (lambda arm: arm.add_command(0, 0.1, duration=float("nan")), "be a number, got nan"),
        (lambda arm: arm.add_command(0, 0.1, duration="1 s"), "be a number, got '1 s'"),
        (lambda arm: arm.add_command(0, 0.1, until=-1), "until must be from 0 to .*, got -1"),
        (lambda arm: arm.add_command(0, 0.1, iterations=0), "iterations must be from 1 .* got 0"),
        (lambda arm: arm.add_command(0, 0.1, iterations=2**70), "must be a whole number, got 1180"),
        (lambda arm: arm.add_command(0, 0.1, mode="replace"), "'overwrite', got 'replace'"),
        (lambda arm: arm.add_command(0, 0.1, profile="smooth"), "'as_sent', got 'smooth'"),
        (lambda arm: arm.add_command(0, 0.1, start="here"), "'observed', got 'here'"),
        (lambda arm: arm.add_command(0, 0.1, start=None), "start must be 'desired' or .* got None"),
        (lambda arm: arm.add_command(0, 0.1, every=0), "every must be positive, got 0"),
        (lambda arm: arm.add_command(0, 0.1, every=True), "every .* got True"),
        (lambda arm: arm.add_command(0, 0.1, fastest=1), "fastest must be True or False, got 1"),
        (lambda arm: arm.add_command(True, 0.1), "index or its name, got True"),
        (lambda arm: arm.add_command(2, 0.1), "shoulder.*elbow"),
        (lambda arm: arm.add_command("wrist", 0.1), "shoulder.*elbow"),
        (lambda arm: arm.add_command(0, 0.1, profile="fastest"), "give fastest=True"),
        (
            lambda arm: arm.add_command(0, 0.1, duration=1.0, iterations=3),
            "one of duration, speed, until, iterations and fastest",
        ),
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


def test_a_float_is_seconds_where_time_is_counted(segment: str) -> None:
    half: Any = 0.5
    with o80.robots.load("two_joints").inline(segment, frequency=500) as arm:
        assert [arm.chunks("elbow", step=5, ease=ease).ease for ease in (0.2, 100)] == [100, 100]
        with pytest.raises(o80.InvalidArgument, match="ease must be seconds"):
            arm.chunks("elbow", step=5, ease=float("nan"))
        for refused, cure in (
            (lambda: arm.add_command("elbow", 0.1, duration=-1), "got -1 s"),
            (lambda: arm.add_command("elbow", 0.1, until=half), "seconds x frequency"),
            (lambda: arm.pulse(at=half), "seconds x frequency"),
            (lambda: arm.burst(half), "seconds x frequency"),
            (lambda: arm.wait_for(half), "seconds x frequency"),
            (lambda: o80.robots.load("two_joints").inline(silence=half), "seconds x frequency"),
        ):
            with pytest.raises(o80.InvalidArgument, match=cure):
                refused()
