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
    manifest = build_prefix / "install_manifest.txt"
    if not os.access(manifest if manifest.exists() else build_prefix, os.W_OK):
        pytest.skip("another user has built o80: cmake notes there what it installs")
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


@pytest.fixture(scope="session")
def scale(tmp_path_factory: pytest.TempPathFactory) -> o80.robots.Robot:
    """A robot library made by a compiler alone."""
    library = tmp_path_factory.mktemp("scale") / "scale.so"
    flags = ["-std=c++20", "-O3", "-shared", "-fPIC", "-Wall", "-Wextra", "-Wpedantic", "-Werror"]
    source = PROJECT.parent / "headers_only.cpp"
    run("c++", *flags, f"-I{PACKAGE / 'include'}", source, "-o", library)
    return o80.robots.load(library)


def test_a_robot_library_needs_the_headers_and_no_more(scale: o80.robots.Robot) -> None:
    with scale.inline() as robot:
        assert robot.burst(2).extended.weight == 2.0


def test_what_a_driver_prints_is_no_part_of_its_fault(scale: o80.robots.Robot) -> None:
    with pytest.raises(o80.DriverError) as caught:
        scale.start("scale-that-is-broken", broken=True)

    assert str(caught.value) == "'scale' failed in start: it finds no zero"
    o80.clean("scale-that-is-broken")


def test_an_inline_robot_that_fails_leaves_no_segment_whose_name_nobody_knows(
    scale: o80.robots.Robot,
) -> None:
    with pytest.raises(o80.DriverError, match="no zero"):
        scale.inline(broken=True)
    with scale.inline(full=2) as robot, pytest.raises(o80.DriverError, match="it is full"):
        robot.burst(5)

    assert not [entry for entry in o80.segments() if entry.name.startswith(f"scale-{os.getpid()}")]
