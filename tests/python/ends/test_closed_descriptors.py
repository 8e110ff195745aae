"""Programs and hosts that were started with closed standard descriptors (cron, supervisors)."""

import ast
import json
import re
import subprocess
import sys
from pathlib import Path

import pytest
from processes import O80, PRODUCT, WAIT, Running

import o80

SUBSETS = [(0,), (1,), (2,), (0, 1, 2)]

closed_subsets = pytest.mark.parametrize(
    "closed", SUBSETS, ids=lambda closed: "".join(map(str, closed))
)


def started(closed: tuple[int, ...], *words: object) -> Running:
    """A program whose descriptors of these numbers are closed."""
    closing = " ".join(f"{number}>&-" for number in closed)
    none = dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.DEVNULL)
    return Running("bash", "-c", f'exec "$@" {closing}', "bash", *words, **none)


def run(closed: tuple[int, ...], *words: object) -> None:
    assert started(closed, O80, *words).wait(WAIT) == 0


@closed_subsets
def test_a_robot_is_recorded_halted_resumed_and_stopped(
    closed: tuple[int, ...], segment: str, path: Path
) -> None:
    words = ["run", "two_joints", "--segment", segment, "--frequency", 100]
    with started(closed, O80, *words) as robot:
        with o80.Frontend(segment, timeout=WAIT) as arm:
            recording = path
            recorder = started(closed, O80, "record", segment, "-o", recording)
            while not recording.exists():
                arm.wait_for(arm.published + 1, timeout=WAIT)
                assert recorder.poll() is None
            run(closed, "halt", segment, "hot")
            arm.wait_for(arm.published + 20, timeout=WAIT)  # the robot says so on its stderr
            halt = arm.halted
            assert halt is not None
            assert halt.text == "hot"
            run(closed, "resume", segment)
            assert arm.halted is None
            recorder.terminate()
            assert recorder.wait(WAIT) == 0
            run(closed, "stop", segment)
        assert robot.wait(WAIT) == 0
        assert len(o80.open(recording)[segment].epochs[0].history()) > 20


HOST = """
import json, os, sys
import o80

def standard():
    return [os.path.exists(f"/proc/self/fd/{number}") for number in (0, 1, 2)]

before = standard()
segment, folder = sys.argv[1:]
with o80.Backend(segment, ["a"]) as backend:
    backend.publish([0.0])
    with o80.Frontend(segment) as arm, o80.Recording(folder + "/run.mcap", arm):
        robot = o80.robots.load("two_joints").start(segment + "-2", frequency=100)
        for number in (1, 2):
            try:
                os.write(number, b"x" * 200)
            except OSError:
                pass
        with robot, robot.frontend() as other:
            other.halt("h")
            arm.halt("h")
            found = [standard(), other.halted.number, arm.halted.number]
found += [standard(), before]
with open(folder + "/found", "w") as file:
    json.dump(found, file)
"""


@closed_subsets
def test_a_host_finds_its_descriptors_as_they_were(
    closed: tuple[int, ...], segment: str, tmp_path: Path
) -> None:
    host = started(closed, sys.executable, "-c", HOST, segment, tmp_path)

    assert host.wait(WAIT) == 0
    expected = [number not in closed for number in (0, 1, 2)]
    found = json.loads((tmp_path / "found").read_text())
    assert found == [expected, 1, 1, expected, expected]


# opened for a moment, or by users' own hands: read only, or closed by the same function
MOMENTS = {
    "base/descriptors.py",
    "cli/__init__.py",
    "robots/doctor/computer.py",
    "view/browser.py",
    "balls/flight_cache.py",
}
# programs, which open_standard_streams() protects, alone or in keep_printing()
PROGRAMS = {"fakes/", "watched_child.py", "view/gate.py", "view/server.py", "lab/"}
OPENS = re.compile(
    r"os\.(open|openpty|pipe|dup|pidfd_open|memfd_create)|socket\.(socket\w*|create_\w+)"
    r"|subprocess\.Popen|_Child|tempfile\.\w*(Temp\w+|mkstemp)|\S*VideoCapture"
)


def unguarded(file: Path) -> list[str]:
    """Calls that open descriptors for longer, outside of above_standard()."""
    tree = ast.parse(file.read_text())
    guarded: set[ast.AST] = set()
    for node in ast.walk(tree):
        guards = (
            [item.context_expr for item in node.items]
            if isinstance(node, ast.With)
            else getattr(node, "decorator_list", [])
        )
        if any(ast.unparse(guard) == "above_standard()" for guard in guards):
            guarded.update(ast.walk(node))
    return [
        f"{file}:{node.lineno}"
        for node in ast.walk(tree)
        if isinstance(node, ast.Call)
        and node not in guarded
        and OPENS.fullmatch(ast.unparse(node.func))
    ]


def test_what_stays_open_is_opened_above_the_standard_descriptors() -> None:
    files = [file for file in PRODUCT if not any(part in str(file) for part in MOMENTS | PROGRAMS)]
    assert not [call for file in files for call in unguarded(file)]


def test_programs_open_missing_standard_descriptors_first() -> None:
    mains = [
        (file, node)
        for file in PRODUCT
        for node in ast.parse(file.read_text()).body
        if isinstance(node, ast.If) and ast.unparse(node.test) == "__name__ == '__main__'"
    ]
    assert len(mains) > 15
    for file, node in mains:
        first = ast.unparse(node.body[0])
        called_first = first in ("open_standard_streams()", "keep_printing()")
        assert called_first or file.name in ("__main__.py", "demo.py", "run_driver.py"), file
