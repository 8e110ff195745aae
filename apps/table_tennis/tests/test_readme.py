"""The README tells the truth: its programs run, its table names every module."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

import o80_table_tennis

README = Path(__file__).resolve().parents[1] / "README.md"
PACKAGE = Path(o80_table_tennis.__file__).parent
PROGRAMS = re.findall(r"^```python\n(.*?)^```", README.read_text(), re.DOTALL | re.MULTILINE)


def modules() -> dict[str, set[str]]:
    """Names of the modules of each package; "" holds those beside them."""
    found: dict[str, set[str]] = {}
    for file in PACKAGE.rglob("*.py"):
        if file.name != "__init__.py":
            package = file.parent.name if file.parent != PACKAGE else ""
            found.setdefault(package, set()).add(file.stem)
    return found


def named() -> dict[str, set[str]]:
    """The same, of the table."""
    found: dict[str, set[str]] = {}
    package = ""
    table = README.read_text().partition("## Find one's way")[2]
    for cell in re.findall(r"^\| (\S.*?) \|", table, re.MULTILINE)[1:]:
        if heading := re.fullmatch(r"\*\*(\w+)\*\*", cell):
            package = heading[1]
            continue
        for name in re.findall(r"`(\w+)`", cell):
            # these stand beside the packages, and the layers below them do not use them
            home = "" if (package, name) in {("rig", "settings"), ("rig", "ending")} else package
            found.setdefault(home, set()).add(name)
    return found


def test_the_table_names_every_module_and_no_other() -> None:
    assert named() == modules()


@pytest.mark.parametrize("program", PROGRAMS, ids=lambda text: text.split("\n")[0])
def test_its_programs_run(program: str, tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-W", "error::UserWarning", "-c", program],
        cwd=tmp_path,
        env={**os.environ, "DISPLAY": "", "WAYLAND_DISPLAY": ""},  # no browser is opened
        capture_output=True,
        text=True,
        timeout=100,
    )
    assert done.returncode == 0, done.stderr
