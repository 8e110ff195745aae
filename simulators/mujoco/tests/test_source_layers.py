"""The sources of the simulator: each folder uses only those before it, and none knows a sport."""

import re
from pathlib import Path

import pytest

SOURCES = Path(__file__).resolve().parents[1] / "src"
LAYERS = ("engine", "balls", "estimates", "driver", "module")
INCLUDE = re.compile(r'^#include "(\w+)/', re.MULTILINE)
SPORTS = re.compile(r"tennis|racket|\bnet\b|\btable\b|landing|opponent", re.IGNORECASE)


@pytest.mark.parametrize("layer", LAYERS)
def test_a_folder_uses_only_those_before_it(layer: str) -> None:
    allowed = {"o80", *LAYERS[: LAYERS.index(layer) + 1]}
    used = {
        folder
        for file in (SOURCES / layer).glob("*.[hc]pp")
        for folder in INCLUDE.findall(file.read_text())
    }

    assert used <= allowed


def test_every_folder_is_a_layer() -> None:
    assert {folder.name for folder in SOURCES.iterdir()} == set(LAYERS)


def test_no_source_has_a_word_of_one_application() -> None:
    words = [
        f"{file.name}: {word}"
        for file in SOURCES.rglob("*.[hc]pp")
        for word in SPORTS.findall(file.read_text())
    ]

    assert not words
