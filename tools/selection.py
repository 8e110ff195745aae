"""Maps the words of `make test ARGS="..."` to tests."""

import difflib
import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

from sources import ROOT

PACKAGES = {
    tests.parent.name: tests
    for group in ("", "*/")
    for tests in ROOT.glob(f"{group}*/tests")
    if ROOT / "build" not in tests.parents
}
#: Folders of tests in C++ by the name of their program, o80_test_<name>.
CPP = {folder.name: folder for folder in ROOT.glob("tests/cpp/*/")} | {
    name: tests / "cpp" for name, tests in PACKAGES.items() if (tests / "cpp").is_dir()
}
#: Folders of tests by word.
NAMED = {file.parent.name: [file.parent] for file in ROOT.glob("tests/*/test_*.py")}
NAMED |= {name: [folder] for name, folder in (CPP | PACKAGES).items()} | {"cpp": [*CPP.values()]}
LEROBOT = "gateways/lerobot"
SUITE = re.compile(r"^(?:TYPED_)?TEST(?:_F|_P)?\((\w+),", re.MULTILINE)


@dataclass
class Selection:
    """Chosen C++ suites by folder, and paths for pytest; `lerobot`: for LeRobot's Python."""

    cpp: dict[str, set[str]] = field(default_factory=dict)
    python: list[str] = field(default_factory=list)
    lerobot: list[str] = field(default_factory=list)

    def cpp_pattern(self) -> str:
        """Returns a pattern of test names for ctest."""
        each = (
            f"{folder}[.]([^.]*/)?({'|'.join(sorted(suites))})[./]"
            for folder, suites in self.cpp.items()
        )
        return f"^({'|'.join(each)})"

    def files(self) -> list[Path]:
        """Returns the chosen Python files."""
        return [ROOT / path.partition("::")[0] for path in self.python if ".py" in path]

    def add(self, place: Path, word: str) -> bool:
        """Adds the tests of a file or folder; returns whether there are any."""
        files = [*place.rglob("*.*")] if place.is_dir() else [place]
        suites = {
            name: {suite for file in inside for suite in SUITE.findall(file.read_text())}
            for name, folder in CPP.items()
            if (inside := [x for x in files if folder in x.parents and x.suffix == ".cpp"])
        }
        for name, found in suites.items():
            self.cpp.setdefault(name, set()).update(found)
        path = word if "::" in word else str(place.relative_to(ROOT))
        in_python = any(x.suffix == ".py" and x.name.startswith("test_") for x in files)
        if in_python:
            (self.lerobot if path.startswith(LEROBOT) else self.python).append(path)
        if LEROBOT.startswith(f"{path}/"):
            self.lerobot.append(LEROBOT)
        return in_python or any(suites.values())


def select(words: Iterable[str]) -> Selection:
    """Selects folders by name, folders and files by path, single tests by pytest's names.

    Raises ValueError for a word that names no tests.
    """
    chosen = Selection()
    for word in words:
        path = (ROOT / word.partition("::")[0]).resolve()
        places = NAMED.get(word, [path] if "/" in word and path.exists() else [])
        found = [chosen.add(place, word) for place in places]
        if not any(found):
            near = difflib.get_close_matches(word, NAMED, 1)
            hint = f", did you mean '{near[0]}'?" if near else "; --help lists what does"
            raise ValueError(f"'{word}' names no tests{hint}")
    return chosen
