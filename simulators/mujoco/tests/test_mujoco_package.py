"""The package o80-mujoco: its robot is found by name, its README runs, its pins agree."""

import re
import subprocess
import sys
import tomllib
from pathlib import Path

import mujoco

import o80
import o80_mujoco

PACKAGE = Path(__file__).resolve().parents[1]


def pins(requirements: list[str]) -> dict[str, str]:
    return dict(each.split("==") for each in requirements if "==" in each)


def test_the_robot_is_found_by_its_name() -> None:
    assert o80_mujoco.library().is_file()
    assert o80.robots.load("mujoco").path == o80_mujoco.library()
    assert ("mujoco", o80_mujoco.library()) in [(r.name, r.path) for r in o80.robots.list()]


def test_it_runs_with_the_mujoco_it_was_compiled_against() -> None:
    project = tomllib.loads((PACKAGE / "pyproject.toml").read_text())
    built = pins(project["build-system"]["requires"])["mujoco-core"]

    assert pins(project["project"]["dependencies"])["mujoco-core"] == built
    assert mujoco.__version__ == built
    assert built in o80.robots.load("mujoco").built_with


def test_the_first_minute_of_the_readme(tmp_path: Path) -> None:
    (program,) = re.findall(r"```python\n(.*?)```", (PACKAGE / "README.md").read_text(), re.DOTALL)
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True, timeout=60
    )

    assert done.returncode == 0, done.stderr
    angle = float(done.stdout.strip(" []\n"))
    assert 0.1 < abs(angle) < 3.0
