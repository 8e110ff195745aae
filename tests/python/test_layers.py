"""Each layer of the core includes only itself and the layers before it."""

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
LAYERS = ("base", "describe", "memory", "control", "runtime", "robot")
ROOMS = {
    "memory": ("os", "segment", "ring"),
    "control": ("motion", "batch", "queue"),
    "runtime": ("journal", "backend", "frontend", "replay"),
    "robot": ("driver", "loop", "group"),
}
INCLUDE = re.compile(r'^#include "(?:o80/)?(\w+)/', re.MULTILINE)
CAST = re.compile(r"\bcast<(.*?)>\(")
CASTER = re.compile(r"std::(string|string_view|vector|optional|pair|tuple|shared_ptr|array)\b")
INCLUDED_CASTER = re.compile(r"#include <nanobind/stl/(\w+)\.h>")
PUBLIC = re.compile(r'^#include "(o80/.*)"', re.MULTILINE)


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


@pytest.mark.parametrize(("layer", "rooms"), ROOMS.items())
def test_a_room_of_a_layer_uses_only_those_before_it(layer: str, rooms: tuple[str, ...]) -> None:
    folder = ROOT / "src" / layer
    assert {path.name for path in folder.iterdir()} == set(rooms)
    upward = [
        f"{file.relative_to(ROOT)} includes {used}"
        for place, room in enumerate(rooms)
        for file in (folder / room).iterdir()
        for used in re.findall(rf'^#include "{layer}/(\w+)/', file.read_text(), re.MULTILINE)
        if used not in rooms[: place + 1]
    ]
    assert not upward


def test_a_room_holds_few_files() -> None:
    """At most 25 in src; a source with its header counts as one."""
    rooms = {file.parent for file in (ROOT / "src").rglob("*.[hc]pp")}
    assert not [room for room in rooms if len({file.stem for file in room.iterdir()}) > 25]


def test_every_folder_of_the_core_is_a_layer() -> None:
    folders = {file.name for file in (ROOT / "include" / "o80").iterdir() if file.is_dir()}

    assert folders <= set(LAYERS)


def reached_from(header: str) -> set[str]:
    """The public headers that this one includes, and those that they include."""
    reached: set[str] = set()
    waiting = [header]
    while waiting:
        name = waiting.pop()
        if name not in reached:
            reached.add(name)
            waiting += PUBLIC.findall((ROOT / "include" / name).read_text())
    return reached


def test_public_headers_include_only_public_headers() -> None:
    includes = re.compile(r'^#include "(.*)"', re.MULTILINE)

    private = [
        f"{file.relative_to(ROOT)} includes {used}"
        for file in (ROOT / "include").rglob("*.hpp")
        for used in includes.findall(file.read_text())
        if not (ROOT / "include" / used).is_file()
    ]

    assert not private


def test_every_public_header_is_reached_from_the_umbrella() -> None:
    public = {str(file.relative_to(ROOT / "include")) for file in (ROOT / "include").rglob("*.hpp")}

    assert public == reached_from("o80/o80.hpp")


@pytest.mark.parametrize(
    "file", sorted((ROOT / "python" / "bindings").glob("*.cpp")), ids=lambda file: file.name
)
def test_a_binding_includes_the_casters_that_it_uses(file: Path) -> None:
    # without its caster, a cast compiles to a throw of std::bad_cast, and the linker may take that
    # copy of the function for all other files
    text = file.read_text()
    used = {word for cast in CAST.findall(text) for word in CASTER.findall(cast)}

    assert used <= set(INCLUDED_CASTER.findall(text))
