"""The words of `make test ARGS=...` choose the tests that they name."""

import re

import pytest

from selection import NoSuchTestsError, select


def test_a_folder_of_the_core_is_named_by_its_layer() -> None:
    chosen = select(["control"])
    assert chosen.cpp == {"control": set()}
    assert chosen.python == []
    assert re.match(chosen.cpp_pattern(), "control.Motion.EndsAtItsTarget")
    assert not re.match(chosen.cpp_pattern(), "robot.Loop.Runs")


def test_a_folder_of_sources_stands_for_the_tests_of_its_layer() -> None:
    assert select(["src/memory"]) == select(["memory"]) == select(["tests/cpp/memory"])


@pytest.mark.parametrize("word", ["pam", "robots/pam"])
def test_a_package_stands_for_its_tests_in_both_languages(word: str) -> None:
    chosen = select([word])
    assert list(chosen.cpp) == ["pam"]
    assert chosen.python == ["robots/pam/tests"]


def test_a_file_of_the_core_stands_for_its_suites() -> None:
    chosen = select(["tests/cpp/memory/ring/lane_test.cpp"])
    assert "LaneTest" in chosen.cpp["memory"]
    assert re.match(chosen.cpp_pattern(), "memory.LaneTest.SendsABatch")
    assert not re.match(chosen.cpp_pattern(), "memory.KillTest.Dies")


def test_a_folder_beside_one_of_its_files_stays_whole() -> None:
    for words in (
        ["memory", "tests/cpp/memory/ring/lane_test.cpp"],
        ["tests/cpp/memory/ring/lane_test.cpp", "memory"],
    ):
        assert select(words).cpp == {"memory": set()}


def test_a_single_test_in_python_is_named_as_pytest_does() -> None:
    one = "tests/python/test_bursts.py::test_a_burst_can_be_cancelled"
    chosen = select([one])
    assert chosen.python == [one]
    assert chosen.names_files
    assert not chosen.needs_programs


def test_tests_of_processes_need_the_programs() -> None:
    assert select(["processes"]).needs_programs
    assert select(["tests/consumer/test_includes.py"]).needs_programs


@pytest.mark.parametrize("word", ["contol", "tests/python/test_none.py", "docs/safety.md"])
def test_a_word_that_names_no_tests_is_refused(word: str) -> None:
    with pytest.raises(NoSuchTestsError, match=word):
        select([word])


def test_the_nearest_name_is_offered() -> None:
    with pytest.raises(NoSuchTestsError, match="did you mean 'control'"):
        select(["contol"])
