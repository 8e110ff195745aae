"""Docstrings begin with the noun or the verb that they are about.

A docstring such as "Of the motors [1/min]" leaves out the one word that the reader needs. Checked
are docstrings of modules, classes, functions and attributes, comments of attributes (`#:`), and the
`///` comments of the installed headers.
"""

import ast
import inspect
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

import o80

ROOT = Path(__file__).resolve().parents[2]
FIRST_WORDS = re.compile(r"(Of|That|Those|What|In which) ")
MARKED = re.compile(r"^(?P<indent>.*?)(?P<mark>#:|///) (?P<text>.*)$")
FOLDERS = (
    "apps",
    "benchmarks",
    "devices",
    "examples",
    "gateways",
    "python",
    "robots",
    "simulators",
    "tests",
    "tools",
)
SOURCES = sorted(
    path
    for path in [ROOT / "conftest.py", *(p for f in FOLDERS for p in (ROOT / f).rglob("*.py"))]
    if path != Path(__file__) and "build" not in path.relative_to(ROOT).parts
)
DESCRIBED = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
HEADERS = sorted((ROOT / "include").rglob("*.hpp"))


def docstrings(source: Path) -> Iterator[tuple[int, str]]:
    """Line and text of each docstring, also of those below attributes."""
    for node in ast.walk(ast.parse(source.read_text())):
        before: ast.stmt | None = None
        for line in getattr(node, "body", []) if isinstance(node, DESCRIBED) else []:
            described = before is None or isinstance(before, (ast.Assign, ast.AnnAssign))
            match line:
                case ast.Expr(value=ast.Constant(value=str(text))) if described:
                    yield line.lineno, text
            before = line


def comments(source: Path) -> Iterator[tuple[int, str]]:
    """Line and text of the first line of each `#:` or `///` comment."""
    before = ""
    for number, line in enumerate(source.read_text().splitlines(), 1):
        found = MARKED.match(line)
        if found and not (before and not found["indent"].strip()):
            yield number, found["text"]
        before = found["mark"] if found else ""


def wrong(source: Path) -> list[str]:
    texts = [*comments(source), *(docstrings(source) if source.suffix == ".py" else ())]
    found = sorted((line, text) for line, text in texts if FIRST_WORDS.match(text.lstrip()))
    return [f"{source}:{line}: {text}" for line, text in found]


@pytest.mark.parametrize("folder", [*FOLDERS, "conftest.py"])
def test_docstrings_begin_with_their_noun_or_verb(folder: str) -> None:
    found = [source for source in SOURCES if source.relative_to(ROOT).parts[0] == folder]

    assert found
    assert not [text for source in found for text in wrong(source)]


def test_every_public_name_is_documented() -> None:
    undocumented = []
    for name in vars(o80)["__all__"]:
        thing = getattr(o80, name)
        if not inspect.isclass(thing) and not inspect.isroutine(thing):
            continue
        if not thing.__doc__:
            undocumented.append(name)
        for member, value in vars(thing).items() if inspect.isclass(thing) else ():
            described = inspect.isroutine(value) or isinstance(value, property)
            if described and member[0] != "_" and not inspect.getdoc(getattr(thing, member)):
                undocumented.append(f"{name}.{member}")
    assert undocumented == []


def test_comments_of_headers_begin_with_their_noun_or_verb() -> None:
    assert len(HEADERS) > 30
    assert not [text for header in HEADERS for text in wrong(header)]
