"""Which files of the tree are ours to format and to check."""

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
FOLDERS = (
    "include",
    "src",
    "python",
    "robots",
    "simulators",
    "devices",
    "gateways",
    "apps",
    "gateways",
    "examples",
    "benchmarks",
    "tests",
    "tools",
)


def cpp_files() -> list[str]:
    """All C++ files, relative to the root."""
    return sorted(
        str(file.relative_to(ROOT))
        for folder in FOLDERS
        for suffix in ("hpp", "cpp")
        for file in (ROOT / folder).rglob(f"*.{suffix}")
    )


def all_left_to_check(tests: Path) -> bool:
    """True if all tests of a Python file are marked `check`; `make test` does not import it."""
    return re.search(r"^pytestmark = \[?pytest\.mark\.check\b", tests.read_text(), re.M) is not None
