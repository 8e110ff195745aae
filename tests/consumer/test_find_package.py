"""A C++ project outside the tree finds o80 in a pip install and in a plain one."""

import ctypes
import os
import shutil
import subprocess
import sysconfig
import tomllib
from pathlib import Path

import pytest

import o80

PROJECT = Path(__file__).parent / "project"
ROOT = Path(__file__).resolve().parents[2]
PACKAGE = Path(o80.__file__).parent


def run(*command: str | Path, **environment: str) -> str:
    """Runs a command to its end and returns what it prints; its output is the failure."""
    result = subprocess.run(
        command,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        env=os.environ | environment,
    )
    assert result.returncode == 0, result.stdout
    return result.stdout


@pytest.fixture(scope="session")
def plain_prefix(build_prefix: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    prefix = tmp_path_factory.mktemp("plain")
    run("cmake", "--install", build_prefix, "--prefix", prefix)
    return prefix


@pytest.fixture(params=["pip install", "virtual environment", "plain install"])
def consumer(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    """The build folder of the consumer, built against one kind of install."""
    source, build = tmp_path / "source", tmp_path / "build"
    shutil.copytree(PROJECT, source)
    hint, environment = [], {}
    if request.param == "pip install":
        hint = [f"-Do80_ROOT={PACKAGE}"]
    elif request.param == "plain install":
        hint = [f"-Do80_ROOT={request.getfixturevalue('plain_prefix')}"]
    else:  # activated: its bin leads the path
        environment = {"PATH": f"{sysconfig.get_path('scripts')}:{os.environ['PATH']}"}
    run("cmake", "-S", source, "-B", build, *hint, **environment)
    run("cmake", "--build", build)
    return build


def test_a_program_runs_with_the_library_it_was_built_against(consumer: Path) -> None:
    version = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]

    assert run(consumer / "version_of_o80").strip() == version


def test_a_robot_library_needs_no_library_of_o80_and_shows_only_what_it_exports(
    consumer: Path,
) -> None:
    robot = consumer / "stranger.so"

    assert "libo80" not in run("readelf", "--dynamic", robot)
    assert "not_for_others" not in run("nm", "--dynamic", robot)
    assert ctypes.CDLL(str(robot)).stranger() == 1


def test_a_robot_library_needs_the_headers_and_a_compiler_no_more(tmp_path: Path) -> None:
    source = PROJECT.parent / "headers_only.cpp"
    flags = ["-std=c++20", "-shared", "-fPIC", "-Wall", "-Wextra", "-Wpedantic", "-Werror"]
    run("c++", *flags, f"-I{PACKAGE / 'include'}", source, "-o", tmp_path / "scale.so")

    with o80.robots.load(tmp_path / "scale.so").inline() as scale:
        assert scale.burst(2).extended.weight == 2.0
