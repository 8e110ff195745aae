"""Set-up names all that is missing in one sentence, with the command, and has then done nothing."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent.parent
REAL = f'exec {sys.executable} "$@"'
WITHOUT_HEADERS = f'case "$2" in *Python.h*) exit 1;; esac\n{REAL}'
TOO_OLD = 'case "$1" in -V) echo Python 3.9.2;; *) exit 1;; esac'


@pytest.mark.parametrize(
    ("purpose", "programs", "missing"),
    [
        ("demo", {}, "as root: apt-get install g++ python3 python3-venv python3-dev\n"),
        ("demo", {"c++": "", "python3": WITHOUT_HEADERS}, "as root: apt-get install python3-dev\n"),
        ("demo", {"c++": "", "python3.13": WITHOUT_HEADERS}, "apt-get install python3.13-dev\n"),
        ("demo", {"c++": "", "python3": TOO_OLD}, "Python 3.9.2 is too old: use Debian 12 "),
        ("environment", {"python3": REAL}, "apt-get install g++ ccache libgtest-dev "),
        ("setup", {"python3": REAL}, "missing: as root: apt-get install g++ ccache "),
    ],
)
def test_names_what_is_missing(
    purpose: str, programs: dict[str, str], missing: str, tmp_path: Path
) -> None:
    """Without apt-get on the PATH nothing is installed, also for root."""
    tree, path = tmp_path / "tree", tmp_path / "path"
    (tree / "tools").mkdir(parents=True)
    path.mkdir()
    shutil.copy(ROOT / "tools" / "setup.sh", tree / "tools")
    for name in ("bash", "date", "dirname", "grep", "id", "ldconfig"):
        (path / name).symlink_to(shutil.which(name, path="/usr/bin:/bin:/usr/sbin:/sbin") or "")
    for name, program in programs.items():
        (path / name).write_text(f"#!/bin/sh\n{program}\n")
        (path / name).chmod(0o755)

    done = subprocess.run(
        [path / "bash", tree / "tools" / "setup.sh", purpose],
        env={"PATH": str(path)},
        capture_output=True,
        text=True,
    )

    assert done.returncode == 1
    (sentence,) = done.stderr.splitlines(keepends=True)
    assert missing in sentence
    assert [file.name for file in tree.iterdir()] == ["tools"]
