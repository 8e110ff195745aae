"""The package as it was installed agrees with what pyproject.toml says."""

import tomllib
from importlib.metadata import entry_points
from pathlib import Path

import o80

PROJECT = tomllib.loads((Path(__file__).resolve().parents[2] / "pyproject.toml").read_text())
PACKAGE = Path(o80.__file__).parent


def pin_of(name: str, requirements: list[str]) -> str:
    """The exact version a list of requirements asks for."""
    [requirement] = [r for r in requirements if r.partition("==")[0] == name]
    return requirement.partition("==")[2]


def test_the_simulator_runs_with_the_mujoco_it_was_compiled_against() -> None:
    built = pin_of("mujoco-core", PROJECT["build-system"]["requires"])

    assert built
    assert built == pin_of("mujoco-core", PROJECT["project"]["dependencies"])


def test_the_compiled_library_has_the_version_of_the_package() -> None:
    assert o80.version() == PROJECT["project"]["version"]


def test_headers_library_and_stub_are_installed_with_the_package() -> None:
    for path in ("include/o80/base/version.hpp", "lib/libo80.so", "_core.pyi", "py.typed"):
        assert (PACKAGE / path).exists(), path


def test_cmake_projects_built_by_python_find_the_package() -> None:
    assert "o80" in {point.value for point in entry_points(group="cmake.prefix")}
