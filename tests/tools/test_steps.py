"""Steps run one after the other in a chain, chains beside each other, and none after a failure."""

import sys
from pathlib import Path

import pytest

import steps
from sources import all_left_to_check
from steps import Step, run_beside


@pytest.fixture(autouse=True)
def _logs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(steps, "ROOT", tmp_path)
    monkeypatch.setattr(steps, "LOGS", tmp_path)


def step(name: str, program: str) -> Step:
    return Step(name, [[sys.executable, "-c", program]])


def made(folder: Path) -> set[str]:
    return {file.name for file in folder.glob("made_*")}


def writes(name: str) -> Step:
    return step(name, f"open('made_{name}', 'w')")


def test_a_chain_ends_at_its_failure_and_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    chain = [writes("a"), step("b", "print('why'); exit(3)"), writes("c")]
    assert run_beside([chain], 1) == {"b"}
    assert made(tmp_path) == {"made_a"}
    said = capsys.readouterr().out
    assert "why\n" in said
    assert "b: FAILED (b.log) in" in said


def test_after_a_failure_no_other_chain_begins_unless_it_is_told_to_go_on(tmp_path: Path) -> None:
    chains = [[step("a", "exit(1)")], [writes("b")]]
    assert run_beside(chains, 1) == {"a"}
    assert made(tmp_path) == set()
    assert run_beside(chains, 1, keep_going=True) == {"a"}
    assert made(tmp_path) == {"made_b"}


def test_two_lanes_run_two_chains_at_the_same_time() -> None:
    """Each of the two waits for the other one."""
    wait = (
        "import pathlib, time\n"
        "pathlib.Path('made_{}').touch()\n"
        "while not pathlib.Path('made_{}').exists(): time.sleep(0.01)\n"
    )
    assert not run_beside(
        [[step("a", wait.format("a", "b"))], [step("b", wait.format("b", "a"))]], 2
    )


@pytest.mark.parametrize(
    ("text", "whole"),
    [
        ("pytestmark = pytest.mark.check  # slow\n", True),
        ("pytestmark = [pytest.mark.check, pytest.mark.timeout(900)]\n", True),
        ("@pytest.mark.check\ndef test_it(): ...\n", False),
        ("pytestmark = pytest.mark.recordings('balls')\n", False),
    ],
)
def test_a_file_is_left_to_check_when_its_module_is_marked(
    text: str, whole: bool, tmp_path: Path
) -> None:
    file = tmp_path / "test_some.py"
    file.write_text(text)
    assert all_left_to_check(file) == whole
