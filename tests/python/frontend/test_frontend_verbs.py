"""Every verb of o80.Frontend: declared in one typed place, documented, and refused in words."""

import ast
import inspect
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from processes import WAIT

import o80
import o80.frontend
from o80 import _core

CLASSES = [each for each in o80.Frontend.__mro__ if each.__module__.startswith("o80.frontend.")]
NAMES = [each.__name__ for each in CLASSES]
SOURCES = sorted({Path(inspect.getfile(each)) for each in CLASSES})


def declared(*, compiled: bool) -> dict[str, ast.FunctionDef]:
    """Verbs that stand under TYPE_CHECKING (compiled), or have a body."""
    found: dict[str, ast.FunctionDef] = {}
    for source in SOURCES:
        for cls in ast.parse(source.read_text()).body:
            if not isinstance(cls, ast.ClassDef) or cls.name not in NAMES:
                continue
            blocks = [block for block in cls.body if isinstance(block, ast.If)]
            body = [verb for block in blocks for verb in block.body] if compiled else cls.body
            found.update({verb.name: verb for verb in body if isinstance(verb, ast.FunctionDef)})
    return {name: verb for name, verb in found.items() if not name.startswith("_")}


def test_declares_every_public_verb_and_no_other() -> None:
    public = {name for name in dir(o80.Frontend) if not name.startswith("_")}
    assert set(declared(compiled=True)) | set(declared(compiled=False)) == public


def test_declares_the_compiled_verbs_as_such() -> None:
    public = {name for name in dir(_core.Frontend) if not name.startswith("_")}
    assert set(declared(compiled=True)) == public


@pytest.mark.parametrize("name", sorted(declared(compiled=True)))
def test_shows_signature_and_help_of_a_compiled_verb_once(name: str) -> None:
    verb = declared(compiled=True)[name]
    method = getattr(_core.Frontend, name)
    said = inspect.getdoc(method) or ""
    text = ast.get_docstring(verb)
    assert text
    assert said.count(text) == 1
    if isinstance(method, property):
        return
    assert said == text
    assert method.__name__ == name
    made = ast.parse(f"def {name}{inspect.signature(method)}: ...").body[0]
    assert isinstance(made, ast.FunctionDef)
    expected = ast.unparse(verb.args).replace("_core.", "")
    assert ast.unparse(made.args) == expected
    assert verb.returns is not None
    assert made.returns is not None
    assert ast.unparse(made.returns) == ast.unparse(verb.returns).replace("_core.", "")


def test_a_method_of_an_object_has_the_signature_without_self(arm: o80.Frontend) -> None:
    assert list(inspect.signature(arm.wait_for).parameters) == ["iteration", "timeout"]


def test_an_error_of_the_call_itself_is_not_taken_for_wrong_arguments(arm: o80.Frontend) -> None:
    class Seven:
        def __index__(self) -> int:
            raise TypeError("no seven today")

    with pytest.raises(o80.InvalidArgument):
        arm.add_command(Seven(), 0.5)


def test_names_each_of_its_files_in_the_table() -> None:
    table = o80.frontend.__doc__ or ""
    for source in SOURCES:
        assert f"| {source.name} |" in table


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda arm: arm.add_command(0, 0.5, 2.0), "give the rest by name"),
        (lambda arm: arm.add_command(0, 0.5, 2.0), "duration, speed, until, iterations"),
        (lambda arm: arm.add_command(0, 0.5, durations=2.0), "did you mean 'duration'?"),
        (lambda arm: arm.add_command(0), "missing 1 required positional argument: 'target'"),
        (lambda arm: arm.pulse(7), "give the rest by name"),
        (lambda arm: arm.wait_for(), "missing 1 required positional argument: 'iteration'"),
        (lambda arm: arm.stream(timout=1.0), "did you mean 'timeout'?"),
        (lambda arm: arm.purge(actuators=0), "did you mean 'actuator'?"),
        (lambda arm: arm.latest(3), "takes 1 positional argument but 2 were given"),
        (lambda arm: arm.halt(1, 2), "halt() takes from 1 to 2 positional arguments"),
        (lambda arm: arm.add_trajectory([[0, 0]], frequency=50), ". It takes targets, actuators"),
        (lambda arm: arm.add_trajectory(), "add_trajectory() missing 1 required positional"),
        (lambda arm: arm.move_to(0, 1.0), "tolerance"),
        (lambda arm: arm.resume(1, 2.0), "give the rest by name"),
    ],
)
def test_refuses_wrong_arguments_in_the_words_of_python(
    arm: o80.Frontend, call: Callable[[Any], object], said: str
) -> None:
    with pytest.raises(TypeError) as refused:
        call(arm)
    assert said in str(refused.value)
    assert "nanobind" not in str(refused.value)
    assert not str(refused.value).endswith("It takes ")
    assert arm.added == 0


@pytest.mark.parametrize("timeout", ["soon", [1.0], float("nan")])
def test_says_what_a_timeout_is(arm: o80.Frontend, timeout: Any) -> None:
    burst = partial(arm.burst, 1)
    for wait in (arm.wait_for_next, arm.pulse_and_wait, arm.pulse().wait, burst):
        with pytest.raises(o80.InvalidArgument, match="timeout must be a number of seconds"):
            wait(timeout=timeout)


def test_takes_whole_numbers_of_seconds(arm: o80.Frontend) -> None:
    arm.burst(3, timeout=5)
    assert arm.wait_for(2, 5).iteration == 2
    assert arm.pulse_and_wait(timeout=5).iteration == 3


def test_it_knows_its_robot(arm: o80.Frontend, segment: str) -> None:
    assert arm.robot == "two_joints"
    assert arm.segment == segment
    assert [actuator.name for actuator in arm.actuators] == ["shoulder", "elbow"]
    assert arm.actuators[1].index == 1
    assert arm.actuators[1].limits.numbers()[:2] == (-3.0, 3.0)
    assert arm.actuators[0].when_idle == "hold"
    assert list(arm.requests) == ["reset", "snapshot", "restore", "home"]
    assert arm.frequency == pytest.approx(1000.0)
    assert arm.period == pytest.approx(0.001)
    assert arm.bursting
    assert arm.alive
    assert [field["name"] for field in arm.schema["extended"]["fields"]] == ["homing", "effort"]


def test_leaving_a_with_block_lets_motion_complete(process: o80.robots.Process) -> None:
    with process.frontend() as watcher:
        with process.frontend() as arm:
            arm.add_command(0, 1.0, iterations=20)
            arm.pulse()
        while watcher.latest().desired[0] < 1.0:
            watcher.wait_for_next(WAIT)


def test_an_error_in_a_with_block_purges_what_the_frontend_sent(
    bursting: o80.robots.Process,
) -> None:
    with bursting.frontend() as other:
        other.add_command(1, 1.0, iterations=100)
        kept = other.pulse()
        with pytest.raises(ZeroDivisionError), bursting.frontend() as arm:  # noqa: PT012
            arm.add_command(0, 1.0, iterations=100)
            batch = arm.pulse()
            arm.add_command(0, 2.0)  # never pulsed, and not worth a warning any more
            raise ZeroDivisionError
        other.burst(1)

        assert batch.statuses == [o80.Status.PURGED]
        assert kept.statuses == [o80.Status.ACTIVE]


def test_control_within_control_changes_nothing(process: o80.robots.Process) -> None:
    def refused_reason(other: o80.Frontend) -> o80.Reason | None:
        other.add_command(0, 1.0)
        sent = other.pulse()
        sent.wait(WAIT, check=False)
        return sent.handles[0].reason if sent.statuses == [o80.Status.REJECTED] else None

    with process.frontend() as arm, process.frontend() as other:
        with arm.control():
            with arm.control():
                assert refused_reason(other) == o80.Reason.EXCLUSIVE
            assert refused_reason(other) == o80.Reason.EXCLUSIVE
            with pytest.raises(o80.ControlTaken), other.control():
                pass
        assert refused_reason(other) is None
        with other.control():
            assert refused_reason(arm) == o80.Reason.EXCLUSIVE


def test_a_reader_takes_no_lane_and_cannot_command(process: o80.robots.Process) -> None:
    with o80.Frontend(process.segment, read_only=True) as reader:
        assert reader.latest().iteration >= 0
        assert reader.wait_for_next(WAIT).iteration > 0
        reader.add_command(0, 0.5)
        with pytest.raises(o80.ReadOnly, match=process.segment):
            reader.pulse()
        reader.forget_added()


def test_it_refuses_to_attach_again_to_another_robot(segment: str) -> None:
    with o80.robots.load("two_joints").start(segment) as process:
        arm = process.frontend()
    with o80.Backend(segment, ["a"]) as backend:
        backend.publish([0.0])
        with pytest.raises(o80.SchemaMismatch, match="open a new frontend"):
            arm.reattach()
    arm.close()


def test_a_frontend_of_a_halted_robot_says_so(segment: str) -> None:
    with o80.robots.load("two_joints").inline(segment, frequency=500) as arm:
        assert repr(arm).endswith("(two_joints), bursting at 500 Hz>")
        arm.halt("too hot")
        assert repr(arm).endswith("bursting at 500 Hz, halted: too hot>")
