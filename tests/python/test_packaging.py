"""The packages as they were installed agree with what their pyproject.toml say."""

import itertools
import os
import re
import tomllib
from importlib.metadata import requires, version
from pathlib import Path
from typing import Any

import pytest
from processes import run_python

import o80
from o80.base.installation import check_version

ROOT = Path(__file__).resolve().parents[2]
INSTALLED = Path(o80.__file__).parent
OTHERS = (
    "simulators/mujoco",
    "robots/pam",
    "robots/arms",
    "devices",
    "gateways/lerobot",
    "gateways/ros2",
    "apps/table_tennis",
)


def pyproject(folder: str = ".") -> dict[str, Any]:
    return tomllib.loads((ROOT / folder / "pyproject.toml").read_text())


def test_the_core_needs_numpy_and_the_command_line_only() -> None:
    needed = [re.split("[<>]", name)[0] for name in pyproject()["project"]["dependencies"]]

    assert needed == ["numpy", "typer", "rich"]


@pytest.mark.parametrize("folder", [".", *OTHERS])
def test_each_package_is_installed_in_the_version_of_this_tree_and_asks_for_the_others_in_it(
    folder: str,
) -> None:
    project = pyproject(folder)["project"]
    extras = project.get("optional-dependencies", {}).values()
    needed = itertools.chain(project["dependencies"], *extras)
    pins = {name.partition("==")[2] for name in needed if re.match(r"o80\b", name)}

    assert project["version"] == version(project["name"]) == o80.__version__
    plain = [name for name in requires(project["name"]) or [] if ";" not in name]
    assert sorted(plain) == sorted(project["dependencies"])
    assert pins == (set() if folder == "." else {o80.__version__})


def test_the_citation_names_the_version() -> None:
    assert f"\nversion: {o80.__version__}\n" in (ROOT / "CITATION.cff").read_text()


def before(folder: Path) -> dict[str, str]:
    """The environment of an interpreter that imports from this folder first."""
    return os.environ | {"PYTHONPATH": f"{folder}:{os.environ.get('PYTHONPATH', '')}"}


def test_packages_of_another_version_than_o80_refuse_to_be_imported(tmp_path: Path) -> None:
    names = [pyproject(folder)["project"]["name"] for folder in OTHERS]
    for name in names:
        found = tmp_path / f"{name.replace('-', '_')}-9.9.dist-info" / "METADATA"
        found.parent.mkdir()
        found.write_text(f"Name: {name}\nVersion: 9.9\n")
    program = "import importlib, sys\nfor name in sys.argv[1:]:\n"
    program += "  try: importlib.import_module(name.replace('-', '_'))\n"
    program += "  except ImportError as error: print(error)\n"
    said = run_python("-c", program, *names, env=before(tmp_path)).stdout.splitlines()

    fits = f"does not fit o80 {o80.__version__}: install both in one version, pip install"
    assert said == [f"{name} 9.9 {fits} {name}=={o80.__version__}" for name in names]
    check_version("sources-without-metadata")  # as in a frozen program


def test_files_of_another_version_than_the_compiled_module_refuse_to_be_imported(
    tmp_path: Path,
) -> None:
    files = (INSTALLED / "__init__.py").read_text()
    (tmp_path / "o80").mkdir()
    stale = files.replace(f'__version__ = "{o80.__version__}"', '__version__ = "9.9"')
    (tmp_path / "o80/__init__.py").write_text(f"__path__.append({str(INSTALLED)!r})\n{stale}")
    done = run_python("-c", "import o80", code=1, env=before(tmp_path))

    assert f"have version 9.9, its compiled module {o80.__version__}" in done.stderr


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
