"""Which tests the words of `make test ARGS="..."` mean."""

import difflib
import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

from sources import ROOT

PACKAGES = [
    each
    for group in ("robots", "simulators", "gateways", "apps")
    for each in ROOT.glob(f"{group}/*/")
]
PACKAGES = [each for each in (*PACKAGES, ROOT / "devices") if (each / "tests").is_dir()]
#: Folders of tests in C++ by the name of their program, o80_test_<name>.
CPP = {folder.name: folder for folder in ROOT.glob("tests/cpp/*/")} | {
    package.name: package / "tests/cpp" for package in PACKAGES if (package / "tests/cpp").is_dir()
}
#: Folders of tests by the words that stand for them.
NAMED = {folder.name: [folder] for folder in ROOT.glob("tests/*/") if folder.name != "data"}
NAMED |= {name: [folder] for name, folder in CPP.items()}
NAMED |= {package.name: [package / "tests"] for package in PACKAGES} | {"cpp": [*CPP.values()]}


class NoSuchTestsError(Exception):
    """A word that names no tests."""


@dataclass
class Selection:
    """Patterns of the suites chosen in C++ by folder, and paths for pytest."""

    cpp: dict[str, set[str]] = field(default_factory=dict)
    python: list[str] = field(default_factory=list)

    def cpp_pattern(self) -> str:
        """Pattern for ctest of the names of these tests."""
        each = (
            f"{folder}[.]([^.]*/)?({'|'.join(sorted(suites))})[./]"
            for folder, suites in self.cpp.items()
        )
        return f"^({'|'.join(each)})"

    def files(self) -> list[Path]:
        """The files in Python among what was asked for."""
        return [ROOT / path.partition("::")[0] for path in self.python if ".py" in path]


def select(words: Iterable[str]) -> Selection:
    """Folders by name, folders and files by path, and single tests as pytest names them."""
    chosen = Selection()
    for word in words:
        path = (ROOT / word.partition("::")[0]).resolve()
        places = NAMED.get(word, [path] if "/" in word and path.exists() else [])
        found = [_add(chosen, place, word) for place in places]
        if not any(found):
            near = difflib.get_close_matches(word, NAMED, 1)
            hint = f", did you mean '{near[0]}'?" if near else "; --help lists what does"
            raise NoSuchTestsError(f"'{word}' names no tests{hint}")
    return chosen


def _add(chosen: Selection, place: Path, word: str) -> bool:
    """Adds the tests of a file or folder; whether there are any."""
    found: dict[str, set[str]] = {}
    for name, folder in CPP.items():
        if folder == place or place in folder.parents:
            found[name] = {".*"}
        elif folder in place.parents and (place.is_dir() or place.suffix == ".cpp"):
            sources = place.rglob("*.cpp") if place.is_dir() else [place]
            text = "".join(source.read_text() for source in sources)
            found[name] = set(re.findall(r"^(?:TYPED_)?TEST(?:_F|_P)?\((\w+),", text, re.M))
    for name, suites in found.items():
        chosen.cpp.setdefault(name, set()).update(suites)
    in_python = place.suffix == ".py" or any(place.rglob("test_*.py"))
    if in_python:
        chosen.python.append(word if "::" in word else str(place.relative_to(ROOT)))
    return bool(found) or in_python
