"""Mistakes in a driver class are errors with a sentence, when the driver is compiled."""

import subprocess
from pathlib import Path

import pytest
from compilers import COMPILERS

import o80

#: Each names its error in its first line, and is right if RIGHT is defined.
PROGRAMS = sorted((Path(__file__).parent / "must_not_compile").glob("*.cpp"))
HEADERS = Path(o80.__file__).parent / "include"
LANGUAGE = ("-std=c++20", f"-I{HEADERS}")


@pytest.fixture(scope="module")
def compiled_headers(tmp_path_factory: pytest.TempPathFactory) -> tuple[str, ...]:
    """Flags that give g++ what all programs include, compiled once."""
    header = tmp_path_factory.mktemp("headers") / "robot.hpp"
    header.write_text('#include "o80/robot/make_table.hpp"\n')
    subprocess.run(["g++", *LANGUAGE, "-x", "c++-header", header], check=True)
    return ("-Winvalid-pch", "-Werror=invalid-pch", "-include", str(header))


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
    compiler: str, program: Path, compiled_headers: tuple[str, ...]
) -> None:
    expected = program.read_text().splitlines()[0].removeprefix("// error: ")
    flags = compiled_headers if compiler == "g++" else ()

    assert expected in errors(compiler, program, *flags)[0]


@pytest.mark.parametrize("program", PROGRAMS, ids=lambda program: program.stem)
def test_without_the_mistake_it_compiles(program: Path, compiled_headers: tuple[str, ...]) -> None:
    assert errors("g++", program, *compiled_headers, "-DRIGHT") == []
