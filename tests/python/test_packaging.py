"""The packages as they were installed agree with what their pyproject.toml say."""

import re
import tomllib
from importlib.metadata import requires, version
from pathlib import Path
from typing import Any

import pytest

import o80

ROOT = Path(__file__).resolve().parents[2]
INSTALLED = Path(o80.__file__).parent
OTHERS = (
    "simulators/mujoco",
    "robots/pam",
    "robots/arms",
    "devices",
    "gateways/ros2",
    "apps/table_tennis",
)


def pyproject(folder: str = ".") -> dict[str, Any]:
    return tomllib.loads((ROOT / folder / "pyproject.toml").read_text())


def test_the_core_needs_numpy_and_the_command_line_only() -> None:
    needed = [re.split("[<>]", name)[0] for name in pyproject()["project"]["dependencies"]]

    assert needed == ["numpy", "typer", "rich"]


@pytest.mark.parametrize("folder", OTHERS)
def test_each_package_asks_for_the_others_in_the_version_of_this_tree(folder: str) -> None:
    versions = {
        project["name"]: project["version"]
        for project in (pyproject(each)["project"] for each in (".", *OTHERS))
    }
    project = pyproject(folder)["project"]
    pins = {
        name.partition("==")[0].partition("[")[0]: name.partition("==")[2]
        for name in project["dependencies"]
        if name.startswith("o80")
    }

    assert "o80" in pins
    assert pins.items() <= versions.items()
    for extra in project.get("optional-dependencies", {}).values():
        for name in extra:
            if name.startswith("o80"):
                assert name.endswith(f"=={versions[name.partition('==')[0].partition('[')[0]]}")


@pytest.mark.parametrize("folder", [".", *OTHERS])
def test_the_installed_package_is_that_of_the_tree(folder: str) -> None:
    project = pyproject(folder)["project"]

    assert version(project["name"]) == project["version"]
    plain = [name.partition(";")[0] for name in requires(project["name"]) or [] if ";" not in name]
    assert sorted(plain) == sorted(project["dependencies"])


def test_packages_share_one_build_backend_and_license() -> None:
    backends = {
        (ROOT / folder / "build_backend" / "beside_o80.py").read_text()
        for folder in ("simulators/mujoco", "robots/pam", "robots/arms")
    }
    licenses = {(ROOT / folder / "LICENSE").read_text() for folder in (".", *OTHERS)}

    assert len(backends) == 1
    assert len(licenses) == 1


def test_headers_library_and_stub_are_installed_with_the_package() -> None:
    for path in ("include/o80/base/version.hpp", "lib/libo80.so", "_core.pyi", "py.typed"):
        assert (INSTALLED / path).exists(), path


def test_the_core_brings_no_robot_but_its_example() -> None:
    bundled = {file.stem for file in (INSTALLED / "lib" / "o80" / "robots").iterdir()}

    assert bundled == {"two_joints"}
