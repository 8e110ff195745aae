"""A layer of the core includes only itself and the layers before it; so do the rooms of Python."""

import ast
import graphlib
import re
import statistics
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
LAYERS = ("base", "describe", "memory", "control", "runtime", "robot")
ROOMS = {
    "memory": ("os", "segment", "ring"),
    "control": ("motion", "batch", "sending", "receiving", "queue"),
    "runtime": ("protocol", "journal", "backend", "frontend", "replay", "playing"),
    "robot": ("driver", "loop", "group"),
}
# two sides that share only what lies below both
APART = ({"sending", "receiving"}, {"backend", "frontend"}, {"replay", "playing"})
PYTHON = ROOT / "python" / "o80"
# rooms of the Python package by floor: a room uses those of lower floors only
FLOORS = (
    ("base",),
    ("rows",),
    ("drivers", "frontend"),
    ("groups", "recording"),
    ("datasets", "joining", "playing", "robots", "view"),
    ("learning", "replaying"),
    ("cli", "hybrid"),
)
FLOOR_OF = {room: floor for floor, rooms in enumerate(FLOORS) for room in rooms}
# the face of the package: what users import or start; nothing inside uses it
FACE = (
    "__init__",
    "__main__",
    "difference",
    "errors",
    "notebook",
    "plot",
    "run_driver",
    "stub",
    "testing",
)
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
    assert {path.name for path in folder.iterdir() if path.suffix != ".md"} == set(rooms)
    upward = [
        f"{file.relative_to(ROOT)} includes {used}"
        for place, room in enumerate(rooms)
        for file in (folder / room).iterdir()
        for used in re.findall(rf'^#include "{layer}/(\w+)/', file.read_text(), re.MULTILINE)
        if used not in rooms[: place + 1] or {room, used} in APART
    ]
    assert not upward


def test_a_room_holds_few_files() -> None:
    """At most 25 in src; a source with its header counts as one."""
    rooms = {file.parent for file in (ROOT / "src").rglob("*.[hc]pp")}
    assert not [room for room in rooms if len({file.stem for file in room.iterdir()}) > 25]


def test_every_folder_of_the_core_is_a_layer() -> None:
    folders = {file.name for file in (ROOT / "include" / "o80").iterdir() if file.is_dir()}

    assert folders <= set(LAYERS)


def module_of(file: Path) -> str:
    """The name of a module below o80: "rows.layout"; of a package its folder."""
    parts = file.relative_to(PYTHON).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" and len(parts) > 1 else parts)


MODULES = {module_of(file): file for file in PYTHON.rglob("*.py")}


def imports_of(file: Path) -> set[str]:
    """The modules of o80 that a file imports, also late or for type checkers; "__init__": o80."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module == "o80":
            names.add("o80")
        elif isinstance(node, ast.ImportFrom):
            names |= {f"{node.module}.{alias.name}" for alias in node.names}
    ours = (name.removeprefix("o80").lstrip(".") for name in names if re.match(r"o80\b", name))
    return {known(path) for path in ours if not path.startswith("_core")} - {module_of(file)}


def known(path: str) -> str:
    """The module that holds a name: "rows.layout" of "rows.layout.Layout"."""
    while path and path not in MODULES:
        path = path.rpartition(".")[0]
    return path or "__init__"


IMPORTS = {module: imports_of(file) for module, file in MODULES.items()}


def room_of(module: str) -> str:
    return module.partition(".")[0]


def test_the_python_package_has_few_rooms_on_few_floors() -> None:
    rooms = {room_of(module) for module in MODULES} - set(FACE)

    assert rooms == set(FLOOR_OF)
    assert len(rooms) <= 15
    assert len(FLOORS) <= 8


def test_a_python_room_uses_only_those_below_it_and_nothing_uses_the_face() -> None:
    wrong = [
        f"{module} imports {used}"
        for module, imports in IMPORTS.items()
        if module not in FACE
        for used in imports
        if room_of(used) != room_of(module)
        and (used in FACE or FLOOR_OF[room_of(used)] >= FLOOR_OF[room_of(module)])
    ]

    assert not wrong


def test_python_modules_import_in_no_circle() -> None:
    assert [*graphlib.TopologicalSorter(IMPORTS).static_order()]  # raises CycleError


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


def test_all_bindings_include_all_casters_by_one_header() -> None:
    bindings = ROOT / "python" / "bindings"
    text = "".join(file.read_text() for file in bindings.glob("*.cpp"))
    used = {word for cast in CAST.findall(text) for word in CASTER.findall(cast)}

    assert "#include <nanobind/" not in text
    assert used <= set(INCLUDED_CASTER.findall((bindings / "nb.hpp").read_text()))


# ---------------------------------------------------------------------------------- the ceilings

CEILINGS = {
    "include, src": (33_922, 0),
    "python/bindings": (5_355, 0),
    "python/o80": (29_411, 0),
    "python/o80/hybrid": (2_458, 0),
    "python/o80/learning/training, python/o80/learning/__main__.py": (1_476, 0),
    "python/o80/view/page": (1_209, 0),
    "docs": (565, 0),
    "devices": (8_293, 4_325),
    "gateways/lerobot": (529, 686),
    "gateways/ros2": (903, 955),
    "robots/arms": (4_565, 3_153),
    "robots/pam, robots/two_joints": (2_108, 1_184),
    "simulators/mujoco": (5_372, 4_673),
    "apps/table_tennis": (8_396, 4_410),
    "benchmarks, tools": (4_158, 0),
    "examples": (1_985, 0),
    "tests, conftest.py": (0, 59_017),
}
"""Most lines of product and of tests in each room. Whoever raises one says why in the commit."""
LANGUAGES = {".py", ".cpp", ".hpp", ".js"}
LARGEST_FILE, MEDIAN_FILE = 600, 100


@cache
def lines_by_file() -> dict[Path, int]:
    """Lines of each source, by its path below the root."""
    beside = [path for path in ROOT.iterdir() if path.name not in ("build", ".git", ".venv")]
    found = (file for path in beside for file in [path, *path.rglob("*")])
    ours = (file for file in found if file.suffix in LANGUAGES and file.is_file())
    return {file.relative_to(ROOT): file.read_bytes().count(b"\n") for file in ours}


def folder_room(source: Path) -> str:
    """The room with the longest folder that holds the source; fails where there is none."""
    holds = {
        folder: room
        for room in CEILINGS
        for folder in room.split(", ")
        if source.is_relative_to(folder)
    }
    assert holds, f"{source} lies in no room: give its folder a row in CEILINGS"
    return holds[max(holds, key=len)]


def test_no_room_grows_unseen() -> None:
    lines = {room: [0, 0] for room in CEILINGS}
    for source, count in lines_by_file().items():
        lines[folder_room(source)]["tests" in source.parts or source.name == "conftest.py"] += count
    for room, (product, tests) in lines.items():
        print(f"{room:30} {product:6} {tests:6}")
    over = [
        f"{room}: {found} lines of {what}, the ceiling is {most}"
        for room, counts in lines.items()
        for what, found, most in zip(("product", "tests"), counts, CEILINGS[room], strict=True)
        if found > most
    ]
    assert not over, "\n".join(over)


def test_files_of_the_product_stay_short() -> None:
    aside = ("tests", "examples", "benchmarks", "tools")
    product = {
        source: count
        for source, count in lines_by_file().items()
        if not set(source.parts) & set(aside) and source.name != "conftest.py"
    }
    assert max(product.values()) <= LARGEST_FILE, max(product, key=lambda name: product[name])
    assert statistics.median(product.values()) <= MEDIAN_FILE
