"""Compilers of robot libraries: g++ in every test, clang in `make check`."""

import shutil

import pytest

CLANG = "clang++-19"
COMPILERS = [
    pytest.param("g++", id="g++"),
    pytest.param(
        CLANG,
        id=CLANG,
        marks=[
            pytest.mark.check,
            pytest.mark.skipif(shutil.which(CLANG) is None, reason=f"{CLANG} is not installed"),
        ],
    ),
]
