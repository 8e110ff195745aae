"""Writes signatures and docstrings of the compiled methods into a C++ header.

They are declared once, under `if TYPE_CHECKING` in the classes of python/o80/frontend, for type
checkers and readers. Usage: verbs.py HEADER SOURCE...
"""

import ast
import sys
from collections.abc import Iterator
from pathlib import Path


def declared(source: str) -> Iterator[tuple[str, str, str]]:
    """Name, signature and docstring of each compiled method that a file declares."""
    for cls in ast.parse(source).body:
        if not isinstance(cls, ast.ClassDef):
            continue
        for block in cls.body:
            if not (isinstance(block, ast.If) and ast.unparse(block.test) == "TYPE_CHECKING"):
                continue
            for verb in block.body:
                if isinstance(verb, ast.FunctionDef):
                    yield verb.name, signature_of(verb, source), ast.get_docstring(verb) or ""


def signature_of(verb: ast.FunctionDef, source: str) -> str:
    """The signature in one line, in nanobind's format."""
    lines = source.splitlines()[verb.lineno - 1 : verb.body[0].lineno - 1]
    text = " ".join(" ".join(lines).split()).removesuffix(":")
    return text.replace("( ", "(").replace(", )", ")").replace("_core.", "")


def main() -> None:
    """Writes the header."""
    header, *sources = map(Path, sys.argv[1:])
    verbs = [verb for source in sources for verb in declared(source.read_text())]
    text = "// Made by verbs.py from the classes in python/o80/frontend.\n#pragma once\n\n"
    text += "struct VerbText {\n  const char *name, *qualified_name, *signature, *help;\n};\n\n"
    text += "namespace verbs {\n"
    for name, signature, help_text in verbs:
        text += f'inline constexpr VerbText {name}{{"{name}", "Frontend.{name}",\n'
        text += f'R"o80({signature})o80",\nR"o80({help_text})o80"}};\n'
    text += "}  // namespace verbs\n"
    if not header.exists() or header.read_text() != text:
        header.write_text(text)


if __name__ == "__main__":
    main()
