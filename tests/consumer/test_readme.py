"""The README: its program, its names, its size. The reader of pages runs all its blocks."""

import re
import subprocess
import sys
from pathlib import Path

import o80

ROOT = Path(__file__).resolve().parent.parent.parent
README = (ROOT / "README.md").read_text()


def test_the_ten_lines_of_python(tmp_path: Path) -> None:
    (program,) = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
    command = [sys.executable, "-c", program]
    said = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True)
    desired, rows, time = said.stdout.splitlines()
    assert desired.startswith("[0.1")
    assert (rows, time) == ("(100, 2)", "0.1 s")


def test_the_names_that_a_user_needs() -> None:
    (sentence,) = re.findall(r"needs twelve names of `o80`: (.*)", README)
    names = re.findall(r"`(\w+)`", sentence)
    assert len(names) == 12
    assert not [name for name in names if not hasattr(o80, name)]


def test_is_short_and_its_film_loads_fast() -> None:
    assert len(README.splitlines()) <= 110
    (film,) = re.findall(r"\((docs/pictures/\S+\.gif)\)", README)
    assert (ROOT / film).stat().st_size < 3e6
