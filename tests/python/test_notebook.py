"""Completions and displays of IPython and Jupyter, with their own code."""

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from IPython.core.interactiveshell import InteractiveShell
from processes import run_python

import o80
from o80 import notebook

# IPython calls its own completers provisional
pytestmark = pytest.mark.filterwarnings("ignore::Warning:IPython", "ignore:.*provisional")


@pytest.fixture
def shell() -> Iterator[InteractiveShell]:
    """A shell of its own, in which o80 has been imported."""
    main = sys.modules["__main__"]  # a shell puts a module of its own there
    made = InteractiveShell()  # type: ignore[no-untyped-call]
    made.Completer.use_jedi = False
    notebook.load_ipython_extension(made)
    made.user_ns["o80"] = o80
    try:
        yield made
    finally:
        assert made.history_manager is not None
        made.history_manager.end_session()
        InteractiveShell.clear_instance()
        sys.modules["__main__"] = main
        made.user_ns.clear()  # IPython keeps each shell, and its arms would keep their memory


def completed(shell: InteractiveShell, text: str) -> set[str]:
    """Offers of the completer at the end of a text, without quotes and brackets."""
    lines = text.split("\n")
    found = shell.Completer.completions(text, len(text)) if len(lines) > 1 else ()
    if len(lines) > 1:
        return {each.text.strip("\"']") for each in found}
    return {each.strip("\"']") for each in shell.complete("", text, len(text))[1]}


JOINTS = {"shoulder", "elbow"}


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ('arm.add_command("', JOINTS),
        ("arm.add_command('el", {"elbow"}),
        ('x = arm.add_command(["shoulder", "', JOINTS),
        ('arm.add_command(\n    "sh', {"shoulder"}),
        ('arm.add_command(actuator="', JOINTS),
        ('arm.add_trajectory(np.zeros((3, 1)), "', JOINTS),
        ('arm.add_trajectory(targets, actuators=["', JOINTS),
        ('arm.move_to("', JOINTS),
        ('arm.purge("', JOINTS),
        ('arm.prepared_burst(5, "', JOINTS),
        ('held.arm.add_command("', JOINTS),
        ('arm.request("res', {"reset", "restore"}),
        ('arm.add_request("s', {"snapshot"}),
        ('group.request("res', {"reset", "restore"}),
        ('group.prepared_burst(1, "', JOINTS),
        ('row.extended["', {"torque"}),
        ('o80.robots.load("two', {"two_joints"}),
    ],
)
def test_names_are_completed_inside_strings(
    shell: InteractiveShell, arm: o80.Frontend, text: str, expected: set[str]
) -> None:
    class Held:
        def __init__(self) -> None:
            self.arm = arm

    with o80.robots.load("two_joints").inline(copies=1) as group:
        shell.user_ns.update(arm=arm, held=Held(), group=group, row=arm.latest(), np=np)
        if "extended" in text:
            expected = set(arm.latest().extended.keys())
        found = completed(shell, text)
        assert expected <= found
        if "extended" not in text:
            assert found == expected


@pytest.mark.parametrize(
    "text", ['o80.Frontend("test-', 'Frontend("test-', 'o80.stop("test-', 'o80.clean(name="test-']
)
def test_segments_are_completed(
    shell: InteractiveShell, arm: o80.Frontend, segment: str, text: str
) -> None:
    shell.user_ns.update(Frontend=o80.Frontend)
    assert completed(shell, text) == {segment}


@pytest.mark.parametrize(
    "text",
    [
        'arm.add_command("elbow", "',
        'arm.add_command("elbow", 0.5, mode="',
        'arm.unknown("',
        'print("',
        'nothing.add_command("',
        'arm.add_command("elbow") or "',
        'touchy.arm.add_command("',
        'o80.Error("',
    ],
)
def test_other_strings_are_left_to_others(
    shell: InteractiveShell, arm: o80.Frontend, text: str
) -> None:
    class Touchy:
        @property
        def arm(self) -> o80.Frontend:
            raise AssertionError("a completion computed it")

    assert notebook.names_at(text, {"arm": arm, "touchy": Touchy(), "o80": o80}) is None
    shell.user_ns.update(arm=arm)
    assert not JOINTS & completed(shell, text)


def test_import_turns_it_on_only_where_ipython_runs() -> None:
    """`import o80` imports no IPython."""

    def run(program: str) -> str:
        return run_python("-c", program).stdout

    assert run("import sys, o80; print('IPython' in sys.modules)") == "False\n"
    assert run("import IPython, o80; print(IPython.get_ipython())") == "None\n"
    program = (
        "from IPython.core.interactiveshell import InteractiveShell as S\n"
        "shell = S.instance()\n"
        "shell.run_cell('import o80')\n"
        "print(len(shell.Completer.custom_matchers))\n"
        "shell.run_line_magic('load_ext', 'o80.notebook')\n"
        "print(len(shell.Completer.custom_matchers))\n"
    )
    assert run(program) == "1\n1\n"


def shown(shell: InteractiveShell, value: Any) -> str:
    """The table that a notebook shows."""
    assert shell.display_formatter is not None
    show = shell.display_formatter.format
    data, _ = show(value, include=["text/html"])  # type: ignore[no-untyped-call]
    assert "<table>" in data["text/html"]
    return str(data["text/html"])


def test_what_the_command_line_prints_as_tables_are_tables(
    shell: InteractiveShell, arm: o80.Frontend, segment: str, path: Path
) -> None:
    assert f"<td>{segment}</td><td>running</td>" in shown(shell, o80.segments())
    actuators = shown(shell, arm.actuators)
    assert "<td>elbow</td><td>float64 [rad]</td><td>-3 to 3" in actuators
    assert "<td>options</td>" in shown(shell, arm.provenance)
    with o80.Recording(path, [segment]) as recording:
        arm.burst(30)
        recording.mark("throw", height=0.5)
    marks = shown(shell, o80.open(path).marks)
    assert f"<td>throw</td><td>{segment} 30</td><td>height=0.5</td>" in marks
    history = shown(shell, arm.history())
    assert "31 observations" in history
    assert "<th>observed.elbow</th>" in history
    assert history.count("<tr>") == 12, "head, five rows, a gap, five rows"
    assert "<td>30</td>" in history
    assert "0 observations" in shown(shell, arm.history()[:0])


def test_a_table_shows_words_and_escapes_what_strangers_wrote(
    shell: InteractiveShell, segment: str
) -> None:
    with o80.Backend(segment, ["<b>arm</b>"]) as backend:
        backend.publish([0.25])
        with o80.Frontend(segment) as frontend:
            told = shown(shell, frontend.actuators) + shown(shell, frontend.history())
    assert "&lt;b&gt;arm" in told
    assert "<b>" not in told
    assert "<td>0.25</td>" in told
