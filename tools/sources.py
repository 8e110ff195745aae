"""Lists the files of the tree to format and check."""

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent


def cpp_files() -> list[str]:
    """Lists all C++ files, relative to the root."""
    folders = (folder for folder in ROOT.glob("[!.]*/") if folder.name != "build")
    return sorted(
        str(file.relative_to(ROOT)) for folder in folders for file in folder.rglob("*.[hc]pp")
    )


def all_left_to_check(tests: Path) -> bool:
    """Whether all tests of a Python file are marked `check`; `make test` skips such files."""
    return re.search(r"^pytestmark = \[?pytest\.mark\.check\b", tests.read_text(), re.M) is not None
