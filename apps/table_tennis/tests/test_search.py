"""The search for the numbers of the hitting policy."""

from pathlib import Path

import pytest

from o80_table_tennis.players.found_parameters import (
    FoundParameters,
    found_settings,
    with_parameters,
)
from o80_table_tennis.players.hitting_policy import HittingSettings
from o80_table_tennis.search import SCALES, Parameters, Score, search, start_parameters


def score_of(parameters: Parameters) -> Score:
    """Best at the start, but for the flight, which should be longer."""
    start = start_parameters() | {"interception.flight": 0.6}
    miss = sum(((parameters[name] - start[name]) / SCALES[name]) ** 2 for name in SCALES)
    return Score(mean_reward=-miss, returns=0, episodes=1)


def test_it_finds_better_numbers() -> None:
    found, score = search(score_of, candidates=300, seed=1)
    assert score.mean_reward > 0.2 * score_of(start_parameters()).mean_reward
    assert found["interception.flight"] == pytest.approx(0.6, abs=0.02)


def test_the_same_seed_finds_the_same_numbers() -> None:
    first = search(score_of, candidates=20, seed=2)
    assert first == search(score_of, candidates=20, seed=2)


def test_found_numbers_are_played_with() -> None:
    found = FoundParameters.load()
    assert set(found.parameters) == set(SCALES)
    assert found_settings().interception.flight == found.parameters["interception.flight"]


def test_a_number_that_does_not_exist_is_refused() -> None:
    with pytest.raises(KeyError, match="speed_of_light"):
        with_parameters(HittingSettings(), {"control.speed_of_light": 1.0})


def test_found_numbers_can_be_kept(tmp_path: Path) -> None:
    found = FoundParameters.load()
    found.save(tmp_path / "again.json")
    assert FoundParameters.load(tmp_path / "again.json") == found
