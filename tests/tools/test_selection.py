"""The words of `make test ARGS=...` choose the tests that they name."""

import re

import pytest

from selection import NAMED, select

LANE, BURSTS = "tests/cpp/memory/ring/lane_test.cpp", "tests/python/frontend/test_bursts.py"
IN_LANE = "memory.LaneTest.SendsABatch"
IN_FOLDER = "memory.StartRaceTest.IsWonByOne"
IN_PAM = "pam.Models/PlantWithAnyMuscle.Pulls/0"
IN_CONTROL = "control.Chunk.EndsAtItsTarget"
EVERY = [IN_LANE, IN_FOLDER, IN_PAM, IN_CONTROL]
CHUNKS = "gateways/lerobot/tests/test_chunks.py"


@pytest.mark.parametrize(
    ("words", "cpp", "python", "lerobot"),
    [
        ("control", [IN_CONTROL], [], []),
        (LANE, [IN_LANE], [], []),
        (f"tests/cpp/memory {LANE}", [IN_LANE, IN_FOLDER], [], []),
        ("pam", [IN_PAM], ["robots/pam/tests"], []),
        ("cpp", EVERY, [], []),
        (f"./{BURSTS} {BURSTS}::test_one", [], [BURSTS, f"{BURSTS}::test_one"], []),
        ("gateways/ros2", [], ["gateways/ros2"], []),
        (f"{CHUNKS} ros2", [], ["gateways/ros2/tests"], [CHUNKS]),
        ("lerobot", [], [], ["gateways/lerobot/tests"]),
        ("./gateways", [], ["gateways"], ["gateways/lerobot"]),
    ],
)
def test_words_choose(words: str, cpp: list[str], python: list[str], lerobot: list[str]) -> None:
    chosen = select(words.split())
    assert (chosen.python, chosen.lerobot) == (python, lerobot)
    assert [test for test in EVERY if chosen.cpp and re.match(chosen.cpp_pattern(), test)] == cpp


@pytest.mark.parametrize("word", ["tests/python/test_none.py", "docs/safety.md", "contol"])
def test_a_word_that_names_no_tests_is_refused(word: str) -> None:
    cure = "did you mean 'control'" if word == "contol" else "--help"
    with pytest.raises(ValueError, match=rf"'{word}' names no tests.*{cure}"):
        select([word])


def test_each_name_chooses_something() -> None:
    assert {"python", "tools", "control", "arms", "ros2"} <= set(NAMED)
    for word in NAMED:
        select([word])
