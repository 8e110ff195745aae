"""Options of every backend are described once: flags, keywords and docs follow."""

import inspect
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import o80
from o80.base.loop_options import LoopOption, loop_options

DOCS = Path(__file__).parents[3] / "docs" / "options.md"

Start = Callable[..., Any]


@pytest.fixture(params=["start", "inline", "Backend"])
def start(request: pytest.FixtureRequest, segment: str) -> Start:
    """Starts something with options, and ends it."""

    def begin(**options: Any) -> None:
        robot = o80.robots.load("two_joints")
        if request.param == "start":
            robot.start(segment, **options).stop()
        elif request.param == "inline":
            robot.inline(segment, **options).close()
        else:
            o80.Backend(segment, ["a"], **options).close()

    return begin


def keywords(function: Callable[..., Any]) -> dict[str, Any]:
    """Keywords after the star, with their defaults."""
    return {
        parameter.name: parameter.default
        for parameter in inspect.signature(function).parameters.values()
        if parameter.kind is inspect.Parameter.KEYWORD_ONLY
    }


@pytest.mark.parametrize(
    ("function", "taken"),
    [
        (o80.robots.Robot.start, lambda option: option.of_start),
        (o80.robots.Robot.inline, lambda option: option.of_inline),
        (o80.Backend.__init__, lambda option: option.of_backend),
    ],
    ids=["start", "inline", "Backend"],
)
def test_every_option_is_a_keyword_without_a_default_of_its_own(
    function: Callable[..., Any], taken: Callable[[LoopOption], bool]
) -> None:
    described = [option for option in loop_options().values() if taken(option)]
    there = keywords(function)

    assert {option.name for option in described} == set(there) & set(loop_options())
    for option in described:
        assert there[option.name] is (False if option.kind == "boolean" else None), option.name


def table() -> str:
    """The table of docs/options.md."""
    lines = [
        "| option | what it is | allowed | if not given | where |",
        "|---|---|---|---|---|",
    ]
    for option in loop_options().values():
        flag = f"--{option.name.replace('_', '-')}"
        where = [
            place
            for place, taken in (
                (f"`{flag}`", option.of_run),
                ("start", option.of_start),
                ("inline", option.of_inline),
                ("Backend", option.of_backend),
            )
            if taken
        ]
        allowed = "" if option.kind == "boolean" else option.allowed
        cells = f"`{option.name}`", option.help, allowed, option.otherwise, ", ".join(where)
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def test_the_table_of_the_docs_is_the_description() -> None:
    assert table() in DOCS.read_text(), f"docs/options.md has another table than:\n{table()}"


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (
            {"frequency": "500"},
            r"frequency must be a number from 0.001 to 1000000 \[1/s\], got '500'",
        ),
        ({"frequency": True}, "frequency must be .* got True"),
        ({"history": 10.5}, "history must be a whole number from 1 .* got 10.5"),
        ({"lanes": 257}, "lanes must be a whole number from 1 to 256, got '257'"),
        ({"permission": "640"}, "permission must be an octal mode .* got '640'"),
        ({"permission": 640}, r"permission must be an octal mode .* got 640 \(octal 1200\)"),
        ({"stale": "Hold"}, "stale must be hold, purge, halt or stop, got 'Hold'"),
    ],
)
def test_each_value_is_checked_in_the_same_words(
    start: Start, options: dict[str, Any], said: str
) -> None:
    with pytest.raises(o80.InvalidArgument, match=said):
        start(**options)


def test_numbers_of_numpy_and_none_are_values(start: Start) -> None:
    start(frequency=np.float32(500), lanes=np.int64(2), history=None, stale=None)


def test_what_only_a_process_has_is_checked_before_it_starts(segment: str) -> None:
    robot = o80.robots.load("two_joints")
    for options, said in (
        ({"cpus": "2,3"}, "cpus must be a list of processors such as 2,3, got '2,3'"),
        ({"priority": 100, "policy": "rr"}, "priority must be a whole number from 1 to 99"),
        ({"policy": "idle"}, "policy must be other, fifo, rr or auto, got 'idle'"),
        ({"bursting": 1}, "bursting must be true or false, got 1"),
    ):
        with pytest.raises(o80.InvalidArgument, match=said):
            robot.start(segment, **options)
    with pytest.raises(o80.InvalidArgument, match="needs --policy fifo, rr or auto"):
        robot.start(segment, priority=50)
    assert not any(entry.name == segment for entry in o80.segments())


@pytest.mark.parametrize("verb", ["start", "inline"])
def test_an_unknown_option_offers_the_nearest_one(segment: str, verb: str) -> None:
    begin = getattr(o80.robots.load("two_joints"), verb)
    with pytest.raises(o80.InvalidArgument, match=r"'frequenzy'.* Did you mean 'frequency'"):
        begin(segment, frequenzy=500)
    with pytest.raises(o80.InvalidArgument, match=r"'gian'.* Did you mean 'gain'"):
        begin(segment, gian=2.0)
    with pytest.raises(o80.InvalidArgument, match="no option 'colour': its own are gain, reach"):
        begin(segment, colour="red")


def test_a_robot_says_what_its_own_options_must_be(segment: str) -> None:
    robot = o80.robots.load("two_joints")
    for begin in (robot.start, robot.inline):
        with pytest.raises(o80.DriverError, match="gain must be positive, got -3"):
            begin(segment, gain=-3)
