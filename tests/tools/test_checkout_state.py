"""A step counts as passed only on exactly the files on which it passed."""

import subprocess
from pathlib import Path

import pytest

import checkout_state
from checkout_state import PassedSteps


@pytest.fixture(params=["git", "no git"])
def checkout(
    request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Path:
    folder = tmp_path / "checkout"
    (folder / "src").mkdir(parents=True)
    (folder / "build").mkdir()
    (folder / ".gitignore").write_text("/build\n")
    (folder / "src" / "a.cpp").write_text("int a;\n")
    if request.param == "git":
        subprocess.run(["git", "init", "-q", folder], check=True)
    monkeypatch.setattr(checkout_state, "ROOT", folder)
    monkeypatch.setenv("GIT_CEILING_DIRECTORIES", str(tmp_path))
    return folder


@pytest.fixture
def passed(checkout: Path) -> PassedSteps:
    steps = PassedSteps(checkout / "build" / "passed.json")
    steps.add("cpp")
    return steps


def again(checkout: Path) -> PassedSteps:
    return PassedSteps(checkout / "build" / "passed.json")


def test_it_counts_while_the_files_stay_the_same(checkout: Path, passed: PassedSteps) -> None:
    (checkout / "build" / "made").write_text("not a source")
    assert again(checkout).contains("cpp")
    assert not again(checkout).contains("python")


def test_a_changed_file_makes_it_count_no_more(checkout: Path, passed: PassedSteps) -> None:
    (checkout / "src" / "a.cpp").write_text("int b;\n")
    assert not again(checkout).contains("cpp")


def test_a_new_or_renamed_file_makes_it_count_no_more(checkout: Path, passed: PassedSteps) -> None:
    (checkout / "src" / "a.cpp").rename(checkout / "src" / "b.cpp")
    assert not again(checkout).contains("cpp")


def test_it_does_not_count_if_a_file_changed_while_it_ran(checkout: Path) -> None:
    steps = again(checkout)
    (checkout / "src" / "a.cpp").write_text("int b;\n")
    steps.add("cpp")
    assert not again(checkout).contains("cpp")


def test_what_is_forgotten_does_not_count(checkout: Path, passed: PassedSteps) -> None:
    passed.forget("cpp")
    assert not again(checkout).contains("cpp")
