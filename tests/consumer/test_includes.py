"""Headers of o80 that the compilation of a robot library reads."""

import subprocess
from pathlib import Path

import pytest
from compilers import COMPILERS

import o80

HEADERS = Path(o80.__file__).parent / "include"
ROBOT = Path(__file__).parent / "headers_only.cpp"

#: All of it: no frontend, backend, lane, spinner or lock. Every robot is compiled again when one of
#: these changes.
NEEDED = """
base/error base/nearest_name base/time base/version
describe/defaults describe/describe describe/described describe/face describe/for_each
describe/hooks describe/options describe/rows describe/schema describe/schema_bytes
describe/shown_model
robot robot/driver robot/driver_checks robot/make_table robot/plant_requests robot/table
runtime/request_server runtime/robot_types
"""


@pytest.mark.parametrize("compiler", COMPILERS)
def test_a_robot_library_reads_only_what_a_robot_needs(compiler: str) -> None:
    compiled = subprocess.run(
        [compiler, "-std=c++20", "-MM", f"-I{HEADERS}", ROBOT],
        capture_output=True,
        text=True,
        check=True,
    )
    prefix = f"{HEADERS / 'o80'}/"
    read = {
        word.removeprefix(prefix).removesuffix(".hpp")
        for word in compiled.stdout.replace("\\\n", " ").split()
        if word.startswith(prefix)
    }

    assert "robot/make_table" in read
    assert read - set(NEEDED.split()) == set()
