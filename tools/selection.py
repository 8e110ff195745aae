"""Which tests the words of `make test ARGS="..."` mean."""

import difflib
import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

from sources import ROOT

#: Folders of tests in Python that need all programs of the preset dev.
NEED_PROGRAMS = ("tests/processes", "tests/consumer")


class NoSuchTestsError(Exception):
    """A word that names no tests; the text says which there are."""


def _packages() -> dict[str, Path]:
    """The folders of the packages beside the core, by name."""
    found = [f for group in ("robots", "simulators", "apps") for f in (ROOT / group).glob("*/")]
    found.append(ROOT / "devices")
    return {folder.name: folder for folder in sorted(found) if (folder / "tests").is_dir()}


def _cpp_folders() -> dict[str, Path]:
    """Folders of tests in C++ by the name of their program, o80_test_<name>."""
    own = {folder.name: folder for folder in sorted((ROOT / "tests/cpp").glob("*/"))}
    return own | {
        name: package / "tests/cpp"
        for name, package in _packages().items()
        if (package / "tests/cpp").is_dir()
    }


def _python_folders() -> dict[str, Path]:
    own = ("python", "processes", "consumer", "proofs", "tools")
    packages = {name: package / "tests" for name, package in _packages().items()}
    return {name: ROOT / "tests" / name for name in own} | {
        name: folder for name, folder in packages.items() if any(folder.glob("test_*.py"))
    }


def names() -> list[str]:
    """The words that stand for folders of tests."""
    return sorted({"cpp", *_cpp_folders(), *_python_folders()})


@dataclass
class Selection:
    """Tests in C++ by folder, with the suites chosen or none for all; paths for pytest."""

    cpp: dict[str, set[str]] = field(default_factory=dict)
    python: list[str] = field(default_factory=list)

    def cpp_pattern(self) -> str:
        """Pattern of the names that ctest gives these tests."""
        each = (
            rf"{folder}\.(\w+/)?({'|'.join(sorted(suites))})[./]" if suites else rf"{folder}\."
            for folder, suites in self.cpp.items()
        )
        return f"^({'|'.join(each)})"

    @property
    def needs_programs(self) -> bool:
        """Whether its tests in Python start programs of the preset dev."""
        return any(path.startswith(NEED_PROGRAMS) for path in self.python)

    @property
    def names_files(self) -> bool:
        """Whether all that was asked for in Python are files, or tests in them."""
        return all(".py" in path for path in self.python)

    def files(self) -> list[Path]:
        """The files among what was asked for in Python."""
        return [ROOT / path.partition("::")[0] for path in self.python if ".py" in path]


def select(words: Iterable[str]) -> Selection:
    """Folders by name, folders and files by path, and single tests as pytest names them."""
    chosen = Selection()
    for word in words:
        path = ROOT / word.partition("::")[0]
        if word in names():
            _add_name(chosen, word)
        elif "/" in word and path.exists():
            _add_path(chosen, path.resolve(), word)
        else:
            near = difflib.get_close_matches(word, names(), 1)
            hint = f", did you mean '{near[0]}'?" if near else ""
            raise NoSuchTestsError(
                f"'{word}' names no tests{hint}\n"
                f"Give a path of a test, or one of: {', '.join(names())}"
            )
    return chosen


def _add_name(chosen: Selection, name: str) -> None:
    for folder in _cpp_folders() if name == "cpp" else ():
        chosen.cpp[folder] = set()
    if name in _cpp_folders():
        chosen.cpp[name] = set()
    if name in _python_folders():
        chosen.python.append(str(_python_folders()[name].relative_to(ROOT)))


def _add_path(chosen: Selection, path: Path, word: str) -> None:
    """A package's folder stands for its tests, a folder of sources for the tests of its layer."""
    for name, folder in _cpp_folders().items():
        if path == folder:
            chosen.cpp[name] = set()
            return
        if folder in path.parents and (path.is_dir() or path.suffix == ".cpp"):
            sources = path.rglob("*.cpp") if path.is_dir() else [path]
            text = "".join(source.read_text() for source in sources)
            suites = re.findall(r"^TEST(?:_F|_P)?\((\w+),", text, re.MULTILINE)
            if name not in chosen.cpp or chosen.cpp[name]:
                chosen.cpp.setdefault(name, set()).update(suites)
            return
    relative = path.relative_to(ROOT)
    if path in _packages().values() or relative.parts[:1] == ("src",):
        _add_name(chosen, relative.parts[1])
    elif path.suffix == ".py" or any(path.rglob("test_*.py")):
        chosen.python.append(word)
    else:
        raise NoSuchTestsError(f"'{word}' holds no tests")
