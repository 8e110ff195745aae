"""Mistakes in a driver class are errors with a sentence, when the driver is compiled."""

import subprocess
from collections.abc import Callable
from functools import cache
from pathlib import Path

import pytest
from compilers import COMPILERS

import o80

#: Each names its error in its first line, and is right if RIGHT is defined.
PROGRAMS = sorted((Path(__file__).parent / "must_not_compile").glob("*.cpp"))
HEADERS = Path(o80.__file__).parent / "include"
LANGUAGE = ("-std=c++20", f"-I{HEADERS}")


Flags = Callable[[str], tuple[str, ...]]


@pytest.fixture(scope="module")
def compiled_headers(tmp_path_factory: pytest.TempPathFactory) -> Flags:
    """Flags that give a compiler what all programs include, compiled once."""
    folder = tmp_path_factory.mktemp("headers")
    header = folder / "robot.hpp"
    header.write_text('#include "o80/robot/make_table.hpp"\n')

    @cache
    def flags(compiler: str) -> tuple[str, ...]:
        compiled = folder / f"robot.hpp.{'gch' if compiler == 'g++' else 'pch'}"
        command = [compiler, *LANGUAGE, "-x", "c++-header", str(header), "-o", str(compiled)]
        subprocess.run(command, check=True)
        if compiler == "g++":
            return ("-Winvalid-pch", "-Werror=invalid-pch", "-include", str(header))
        return ("-include-pch", str(compiled))

    return flags


def errors(compiler: str, program: Path, *flags: str) -> list[str]:
    compiled = subprocess.run(
        [compiler, *LANGUAGE, "-fsyntax-only", *flags, program],
        capture_output=True,
        text=True,
    )
    found = [line for line in compiled.stderr.splitlines() if "error:" in line]
    assert (compiled.returncode != 0) == bool(found), compiled.stderr
    return found


@pytest.mark.parametrize("program", PROGRAMS, ids=lambda program: program.stem)
@pytest.mark.parametrize("compiler", COMPILERS)
def test_the_first_error_says_what_is_wrong(
    compiler: str, program: Path, compiled_headers: Flags
) -> None:
    expected = program.read_text().splitlines()[0].removeprefix("// error: ")

    assert expected in errors(compiler, program, *compiled_headers(compiler))[0]


@pytest.mark.parametrize("program", PROGRAMS, ids=lambda program: program.stem)
def test_without_the_mistake_it_compiles(program: Path, compiled_headers: Flags) -> None:
    assert errors("g++", program, *compiled_headers("g++"), "-DRIGHT") == []
