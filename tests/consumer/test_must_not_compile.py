"""Mistakes in a driver class are errors with a sentence, when the driver is compiled."""

import shutil
import subprocess
from pathlib import Path

import pytest

import o80

#: Each names its error in its first line, and is right if RIGHT is defined.
PROGRAMS = sorted((Path(__file__).parent / "must_not_compile").glob("*.cpp"))
COMPILERS = [name for name in ("g++", "clang++-19") if shutil.which(name)]
HEADERS = Path(o80.__file__).parent / "include"


def errors(compiler: str, program: Path, *flags: str) -> list[str]:
    compiled = subprocess.run(
        [compiler, "-std=c++20", "-fsyntax-only", f"-I{HEADERS}", *flags, program],
        capture_output=True,
        text=True,
    )
    found = [line for line in compiled.stderr.splitlines() if "error:" in line]
    assert (compiled.returncode != 0) == bool(found), compiled.stderr
    return found


@pytest.mark.parametrize("program", PROGRAMS, ids=lambda program: program.stem)
@pytest.mark.parametrize("compiler", COMPILERS)
def test_the_first_error_says_what_is_wrong(compiler: str, program: Path) -> None:
    expected = program.read_text().splitlines()[0].removeprefix("// error: ")

    assert expected in errors(compiler, program)[0]


@pytest.mark.parametrize("program", PROGRAMS, ids=lambda program: program.stem)
def test_without_the_mistake_it_compiles(program: Path) -> None:
    assert errors(COMPILERS[0], program, "-DRIGHT") == []
