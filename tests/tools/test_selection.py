"""The words of `make test ARGS=...` choose the tests that they name."""

import re

import pytest

from selection import NoSuchTestsError, select

LANE, BURSTS = "tests/cpp/memory/ring/lane_test.cpp", "tests/python/frontend/test_bursts.py"
IN_LANE = "memory.LaneTest.SendsABatch"
IN_FOLDER = "memory.KillTest.Dies"


@pytest.mark.parametrize(
    ("words", "cpp", "python"),
    [
        ("control", ["control.Motion.EndsAtItsTarget", "control.Seeds/Some.Test/0"], []),
        (LANE, [IN_LANE], []),
        (f"{LANE} memory", [IN_LANE, IN_FOLDER], []),
        (f"tests/cpp/memory {LANE}", [IN_LANE, IN_FOLDER], []),
        ("pam", ["pam.Muscle.Pulls"], ["robots/pam/tests"]),
        ("robots/pam", ["pam.Muscle.Pulls"], ["robots/pam"]),
        ("cpp", [IN_LANE, "pam.Muscle.Pulls", "devices.BlobFinder.Finds"], []),
        ("python", [], ["tests/python"]),
        (f"./{BURSTS}", [], [BURSTS]),
        (f"{BURSTS}::test_one", [], [f"{BURSTS}::test_one"]),
    ],
)
def test_words_choose(words: str, cpp: list[str], python: list[str]) -> None:
    chosen = select(words.split())
    assert chosen.python == python
    matched = [test for test in cpp if re.match(chosen.cpp_pattern(), test)]
    assert (matched, bool(chosen.cpp)) == (cpp, bool(cpp))


def test_a_file_in_cpp_stands_for_its_own_suites() -> None:
    assert not re.match(select([LANE]).cpp_pattern(), IN_FOLDER)
    assert not re.match(select(["control"]).cpp_pattern(), IN_LANE)


@pytest.mark.parametrize("word", ["tests/python/test_none.py", "docs/safety.md", "contol"])
def test_a_word_that_names_no_tests_is_refused(word: str) -> None:
    cure = "did you mean 'control'" if word == "contol" else "--help"
    with pytest.raises(NoSuchTestsError, match=rf"'{word}' names no tests.*{cure}"):
        select([word])
