"""Runs the programs of the pages in docs/: those of commands.md, then those in docs/commands."""

import re
from pathlib import Path

DOCS = Path(__file__).resolve().parents[2] / "docs"


def programs(page: str) -> list[str]:
    """Returns the Python blocks of a page, and of the pages in the folder of its name."""
    pages = [DOCS / page, *sorted((DOCS / page).with_suffix("").glob("*.md"))]
    text = "".join(file.read_text() for file in pages)
    return re.findall(r"^```python\n(.*?)^```", text, re.MULTILINE | re.DOTALL)


def run_programs(page: str, **names: object) -> int:
    """Runs a page's programs in one module; returns their number."""
    blocks = programs(page)
    for program in blocks:
        exec(compile(program, page, "exec"), names)
    return len(blocks)
