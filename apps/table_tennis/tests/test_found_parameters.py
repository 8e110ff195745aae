"""The numbers of the hitting policy that a search has found."""

from pathlib import Path

import pytest

from o80_table_tennis.players.found_parameters import (
    FoundParameters,
    found_settings,
    with_parameters,
)
from o80_table_tennis.players.hitting_policy import HittingSettings


def test_found_numbers_are_played_with() -> None:
    found = FoundParameters.load()
    assert found_settings().interception.flight == found.parameters["interception.flight"]


def test_a_number_that_does_not_exist_is_refused() -> None:
    with pytest.raises(KeyError, match="speed_of_light"):
        with_parameters(HittingSettings(), {"control.speed_of_light": 1.0})


def test_found_numbers_can_be_kept(tmp_path: Path) -> None:
    found = FoundParameters.load()
    found.save(tmp_path / "again.json")
    assert FoundParameters.load(tmp_path / "again.json") == found
