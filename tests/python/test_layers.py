"""Each layer of the core includes only itself and the layers before it."""

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
LAYERS = ("base", "describe", "memory", "control", "runtime", "robot")
INCLUDE = re.compile(r'^#include "o80/(\w+)/', re.MULTILINE)


def sources(layer: str) -> Iterator[Path]:
    for folder in ("include/o80", "src"):
        yield from (ROOT / folder / layer).rglob("*.[hc]pp")


@pytest.mark.parametrize("layer", LAYERS)
def test_a_layer_uses_only_those_before_it(layer: str) -> None:
    allowed = LAYERS[: LAYERS.index(layer) + 1]
    if layer == "control":  # memory and control lie side by side: no memory in control
        allowed = ("base", "describe", "control")

    upward = [
        f"{file.relative_to(ROOT)} includes {used}"
        for file in sources(layer)
        for used in INCLUDE.findall(file.read_text())
        if used not in allowed
    ]

    assert not upward


def test_every_folder_of_the_core_is_a_layer() -> None:
    folders = {file.name for file in (ROOT / "include" / "o80").iterdir() if file.is_dir()}

    assert folders <= set(LAYERS)
